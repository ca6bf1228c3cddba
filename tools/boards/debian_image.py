"""Debian for the emulated board, installed without root privileges in the user's cache folder.

`debootstrap` fetches and verifies the packages, which are only unpacked. Their installation scripts are aarch64 code
and would take half an hour in QEMU; the little that the board needs of them is done here: users, links, units.
"""

from __future__ import annotations

import importlib.metadata
import logging
import os
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import xxhash

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.cache import cache_folder, entry_name
from tools.boards.initramfs import DRIVERS, INIT, write_initramfs

log = logging.getLogger(__name__)

SUITE, PYTHON = "bookworm", "3.11"
PACKAGES = (
    "systemd-sysv",
    "udev",
    "python3",
    "iproute2",
    "kmod",
    "busybox-static",
    "linux-image-cloud-arm64",
)
# packages needed by an installed kernel only
LEFT_OUT = ("linux-image", "linux-base", "initramfs-tools", "klibc-utils", "libklibc")

# the same versions as the host's estimator
WHEELS = ("numpy", "opencv-contrib-python-headless")
PLATFORMS = ("manylinux_2_28_aarch64", "manylinux_2_27_aarch64", "manylinux2014_aarch64")
SITE = f"usr/local/lib/python{PYTHON}/dist-packages"

PROGRAMS = {
    "qemu-system-aarch64": "qemu-system-arm",
    "debootstrap": "debootstrap",
    "fakeroot": "fakeroot",
    "mke2fs": "e2fsprogs",
    "dpkg-deb": "dpkg",
    "wget": "wget",
}

DISK_BYTES = 2 << 30  # sparse: about half is used

NETWORK = "[Match]\nType=ether\n[Network]\nDHCP=ipv4\n"

# the job is a tar archive in place of a disk: board.pyz, a script named `run`, and the files that it reads
JOB = """\
[Unit]
Description=What this start of the emulated board is for
SuccessAction=poweroff-force
FailureAction=poweroff-force
[Service]
Type=oneshot
RuntimeDirectory=job
WorkingDirectory=/run/job
StandardOutput=tty
StandardError=tty
TTYPath=/dev/hvc0
ExecStart=/bin/sh -c 'tar -x -f /dev/vdb && exec sh ./run'
[Install]
WantedBy=multi-user.target
"""

FILES = {
    "etc/machine-id": "b0a2d000000000000000000000000025\n",  # an empty one would ask at the first start
    "etc/hostname": "emulated-board\n",
    "etc/fstab": "",
    "etc/systemd/network/ether.network": NETWORK,
    "etc/systemd/system/flyaround-job.service": JOB,
}
UNITS = "etc/systemd/system"
LINKS = {
    "bin": "usr/bin",
    "lib": "usr/lib",
    "sbin": "usr/sbin",
    f"{UNITS}/systemd-binfmt.service": "/dev/null",
    # a login prompt would occupy the job's console
    f"{UNITS}/serial-getty@hvc0.service": "/dev/null",
    f"{UNITS}/multi-user.target.wants/flyaround-job.service": f"/{UNITS}/flyaround-job.service",
    f"{UNITS}/multi-user.target.wants/systemd-networkd.service": "/lib/systemd/system/systemd-networkd.service",
    f"{UNITS}/network-online.target.wants/systemd-networkd-wait-online.service": (
        "/lib/systemd/system/systemd-networkd-wait-online.service"
    ),
}


@dataclass(frozen=True)
class BoardImage:
    """Files from which QEMU starts: kernel, initial file system, disk."""

    folder: Path

    @property
    def kernel(self) -> Path:
        """Kernel of Debian."""
        return self.folder / "vmlinuz"

    @property
    def initramfs(self) -> Path:
        """Drivers of the emulated devices."""
        return self.folder / "initramfs.gz"

    @property
    def disk(self) -> Path:
        """The root file system, ext4."""
        return self.folder / "root.ext4"


def image_name() -> str:
    """Return the name of the image in the cache; it depends on the recipe and on the versions of NumPy and OpenCV."""
    return entry_name(
        "board-qemu",
        (board_image, write_initramfs),
        SUITE,
        PACKAGES,
        _pinned(),
        sorted(FILES.items()),
        sorted(LINKS.items()),
        (DRIVERS, INIT),
    )


def board_image() -> BoardImage:
    """Return the image, from the cache if complete; otherwise it is made in a minute or two.

    Raises
    ------
    UserError
        If a program is missing, or the image cannot be made.
    """
    image = BoardImage(cache_folder("boards") / image_name())
    if not is_frame_complete(image):
        missing_programs()
        shutil.rmtree(image.folder, ignore_errors=True)
        image.folder.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=image.folder.parent, prefix="unfinished-") as name:
            _make(Path(name))
            folder = Path(name) / "image"
            _manifest(folder).write_bytes(msgspec.json.encode(_hashes(BoardImage(folder))))
            folder.rename(image.folder)
    return image


def is_frame_complete(image: BoardImage) -> bool:
    """Return True if all files of an image exist unchanged."""
    try:
        return bool(msgspec.json.decode(_manifest(image.folder).read_bytes()) == _hashes(image))
    except (OSError, msgspec.DecodeError):
        return False


def missing_programs() -> None:
    """Raise unless the programs that make and run the image are installed.

    Raises
    ------
    UserError
        If one is missing; the message names the packages to install.
    """
    packages = sorted(package for program, package in PROGRAMS.items() if _found(program) is None)
    if packages:
        raise UserError(
            f"the emulated board needs Debian packages that are not installed; run once:"
            f" sudo apt-get install -y --no-install-recommends {' '.join(packages)}"
        )


def _found(program: str) -> str | None:
    # directory outside the PATH of ordinary users
    return shutil.which(program) or shutil.which(program, path="/usr/sbin:/sbin")


def _pinned() -> tuple[str, ...]:
    return tuple(f"{name}=={importlib.metadata.version(name)}" for name in WHEELS)


def _manifest(folder: Path) -> Path:
    return folder / "manifest.json"


def _hashes(image: BoardImage) -> dict[str, str]:
    hashes = {}
    for path in (image.kernel, image.initramfs, image.disk):
        digest = xxhash.xxh3_128()
        with path.open("rb") as file:
            while part := file.read(1 << 22):
                digest.update(part)
        hashes[path.name] = digest.hexdigest()
    return hashes


def _make(work: Path) -> None:
    root, image = work / "root", BoardImage(work / "image")
    image.folder.mkdir()
    log.info("fetching Debian %s for arm64", SUITE)
    options = ["--download-only", "--arch=arm64", "--variant=minbase", "--include=" + ",".join(PACKAGES)]
    _run(["fakeroot", "debootstrap", *options, SUITE, str(work / "fetched")], work / "debootstrap.log")
    packages = sorted((work / "fetched" / "var" / "cache" / "apt" / "archives").glob("*.deb"))
    log.info("unpacking %d packages, NumPy and OpenCV", len(packages))
    for name, target in LINKS.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        if "/" not in name:
            (root / target).mkdir(parents=True, exist_ok=True)
        (root / name).symlink_to(target)
    for package in packages:
        if not package.name.startswith(LEFT_OUT):
            _unpack(package, root)
    _take_kernel(packages, work, image)
    _add_wheels(root, work / "wheels")
    for name, text in FILES.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")
    for name in ("passwd", "group"):
        shutil.copyfile(root / "usr" / "share" / "base-passwd" / f"{name}.master", root / "etc" / name)
    with image.disk.open("wb") as disk:
        disk.truncate(DISK_BYTES)
    # under fakeroot all files belong to root
    _run(
        ["fakeroot", "mke2fs", "-q", "-F", "-t", "ext4", "-d", str(root), str(image.disk)],
        work / "mke2fs.log",
    )


def _unpack(package: Path, folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    # a folder that is a link to another is kept: /bin is /usr/bin
    script = 'dpkg-deb --fsys-tarfile "$0" | tar -x --keep-directory-symlink --no-same-owner -p -C "$1"'
    _run(["bash", "-o", "pipefail", "-c", script, str(package), str(folder)], folder.with_suffix(".log"))


def _take_kernel(packages: list[Path], work: Path, image: BoardImage) -> None:
    """Extract the kernel, and the drivers of the root file system, from their packages."""
    for name in ("linux-image-6.", "busybox-static_"):
        _unpack(next(package for package in packages if package.name.startswith(name)), work / "kernel")
    kernel = work / "kernel"
    shutil.copyfile(next(kernel.glob("boot/vmlinuz-*")), image.kernel)
    write_initramfs(image.initramfs, kernel / "lib" / "modules", kernel / "bin" / "busybox")


def _add_wheels(root: Path, folder: Path) -> None:
    platforms = [f"--platform={name}" for name in PLATFORMS]
    options = ["--quiet", "--no-deps", "--only-binary=:all:", f"--python-version={PYTHON}", *platforms]
    _run(
        [sys.executable, "-m", "pip", "download", *options, "-d", str(folder), *_pinned()],
        folder.with_suffix(".log"),
    )
    for wheel in folder.glob("*.whl"):
        zipfile.ZipFile(wheel).extractall(root / SITE)


def _run(command: list[str], log: Path) -> None:
    """Run a program at the lowest priority, with its output in a file.

    Raises
    ------
    UserError
        If it fails; the message has the last lines of its output.
    """
    environment = os.environ | {"PATH": os.environ.get("PATH", "") + ":/usr/sbin:/sbin"}
    with log.open("ab") as out:
        code = subprocess.run(
            ["nice", *command],
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=subprocess.STDOUT,
            env=environment,
            check=False,
        ).returncode
    if code:
        program = next(word for word in command if word != "fakeroot" and not word.startswith(("-", "/")))
        raise UserError(f"{program} failed with code {code} while the emulated board was made: {_tail(log)}")


def _tail(log: Path) -> str:
    lines = log.read_text(encoding="utf-8", errors="replace").split("\n")
    return " / ".join(line.strip() for line in lines if line.strip())[-600:]
