"""Initial file system of Linux: busybox, drivers of QEMU's devices and one script."""

from __future__ import annotations

import gzip
import re
import stat
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

# drivers of QEMU's `virt` machine; their dependencies are added
DRIVERS = ("virtio_pci", "virtio_blk", "virtio_net", "virtio_console", "virtio_rng", "autofs4")

INIT = """\
#!/busybox sh
/busybox mount -t devtmpfs devtmpfs /dev
for driver in {drivers}; do /busybox insmod /drivers/$driver.ko; done
while ! [ -b /dev/vda ]; do /busybox sleep 0.1; done
/busybox mount -t ext4 -o rw,noatime /dev/vda /root
/busybox mount -o move /dev /root/dev
exec /busybox switch_root -c /dev/console /root /sbin/init
"""


def write_initramfs(path: Path, kernel_modules: Path, busybox: Path) -> None:
    """Write the archive that the kernel unpacks.

    Parameters
    ----------
    path : Path
        File to write.
    kernel_modules : Path
        Folder with the ``.ko`` files of the kernel, at any depth.
    busybox : Path
        Statically linked busybox.

    Raises
    ------
    FileNotFoundError
        If a driver is not among the modules.
    """
    modules = {_plain(file.stem): file.read_bytes() for file in kernel_modules.rglob("*.ko")}
    order = loading_order(modules, DRIVERS)
    files = [
        *((name, stat.S_IFDIR | 0o755, b"") for name in ("dev", "root", "drivers")),
        ("busybox", stat.S_IFREG | 0o755, busybox.read_bytes()),
        ("init", stat.S_IFREG | 0o755, INIT.format(drivers=" ".join(order)).encode()),
        *((f"drivers/{name}.ko", stat.S_IFREG | 0o644, modules[name]) for name in order),
    ]
    path.write_bytes(gzip.compress(cpio(files), mtime=0))


def loading_order(modules: dict[str, bytes], names: Iterable[str]) -> list[str]:
    """Return the names of the wanted modules and their dependencies, each after its own dependencies.

    Parameters
    ----------
    modules : dict of str to bytes
        Contents of the files, by name with underscores.
    names : iterable of str
        Modules to load.

    Raises
    ------
    FileNotFoundError
        If a module is missing.
    """
    order: list[str] = []

    def add(name: str) -> None:
        if name in order:
            return
        if name not in modules:
            raise FileNotFoundError(f"the kernel package has no driver {name}")
        match = re.search(rb"\0depends=([^\0]*)\0", modules[name])
        for needed in match[1].decode().split(",") if match else ():
            if needed:
                add(_plain(needed))
        order.append(name)

    for name in names:
        add(_plain(name))
    return order


def cpio(files: Sequence[tuple[str, int, bytes]]) -> bytes:
    """Return an archive in the ``newc`` format, from (path, mode, content), owned by root."""
    out = bytearray()
    for number, (name, mode, content) in enumerate([*files, ("TRAILER!!!", 0, b"")], start=1):
        fields = (number, mode, 0, 0, 1, 0, len(content), 0, 0, 0, 0, len(name) + 1, 0)
        out += b"070701" + "".join(f"{field:08x}" for field in fields).encode() + name.encode() + b"\0"
        out += bytes(-len(out) % 4) + content
        out += bytes(-len(out) % 4)
    return bytes(out)


def _plain(name: str) -> str:
    return name.replace("-", "_")
