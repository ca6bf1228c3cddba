"""QEMU as a board: its command line, its job, and its two lines to the host."""

from __future__ import annotations

import io
import re
import subprocess
import tarfile
import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from tools.boards.debian_image import BoardImage

# the processor of a Raspberry Pi 4
CPU = "cortex-a72"


def qemu_command(image: BoardImage, job: Path) -> list[str]:
    """Return the command line of an emulated board; changes to its disk are discarded at the end.

    The first serial port (a PL011, ``/dev/ttyAMA0`` on the board) is a pseudo-terminal of this machine, whose name QEMU
    prints on standard output; the console is another device, connected to standard output. The host's loopback address
    is 10.0.2.2 on the board, and no connection to the board can be opened from outside.

    Parameters
    ----------
    image : BoardImage
        Disk image and kernel of the board.
    job : Path
        Tar archive that the board unpacks and whose ``run`` it executes.
    """
    return [
        *("qemu-system-aarch64", "-M", "virt", "-cpu", CPU, "-smp", "1", "-m", "1024", "-accel", "tcg"),
        *("-nographic", "-monitor", "none", "-no-reboot"),
        *(
            "-kernel",
            str(image.kernel),
            "-initrd",
            str(image.initramfs),
            "-append",
            "console=hvc0 quiet panic=-1",
        ),
        *("-device", "virtio-rng-pci"),
        *("-drive", _drive("root", image.disk, "snapshot=on"), "-device", "virtio-blk-pci,drive=root"),
        *("-drive", _drive("job", job, "readonly=on"), "-device", "virtio-blk-pci,drive=job"),
        *("-chardev", "pty,id=uart", "-serial", "chardev:uart"),
        *("-device", "virtio-serial-pci", "-chardev", "stdio,id=console,signal=off"),
        *("-device", "virtconsole,chardev=console"),
        *("-netdev", "user,id=net", "-device", "virtio-net-pci,netdev=net,romfile="),
    ]


@dataclass(frozen=True)
class EmulatedBoard:
    """A running board: its console output, and the device of this machine that its serial port is connected to."""

    process: subprocess.Popen[bytes]
    console: Path
    uart: str

    def said(self) -> str:
        """Return the console output so far."""
        return self.console.read_text(encoding="utf-8", errors="replace").replace("\r\n", "\n")

    def wait_for(self, text: str, timeout_s: float) -> str:
        """Return the console output as soon as it contains ``text``.

        Raises
        ------
        UserError
            If they do not appear in time, or the board ends before they appear.
        """
        end_s = time.monotonic() + timeout_s
        while text not in self.said():
            if self.process.poll() is not None or time.monotonic() > end_s:
                last = " / ".join(self.said().split("\n")[-8:])
                raise UserError(
                    f"the emulated board did not print {text!r} in {timeout_s:g} s: {self.console} ends with {last}"
                )
            time.sleep(0.2)
        return self.said()


@contextmanager
def emulated_board(image: BoardImage, files: Mapping[str, bytes], folder: Path) -> Iterator[EmulatedBoard]:
    """Run a board with a job until the block is left.

    Parameters
    ----------
    image : BoardImage
        Disk image and kernel of the board.
    files : mapping of str to bytes
        Files of the job by name, among them the shell script ``run``, which runs as root.
    folder : Path
        Folder for the job and the console's output.

    Raises
    ------
    UserError
        If QEMU does not start.
    """
    job, console = folder / "job.tar", folder / "console.log"
    with tarfile.open(job, "w") as archive:
        for name, content in files.items():
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            archive.addfile(entry, io.BytesIO(content))
    with console.open("wb") as out:
        # at the lowest priority
        process = subprocess.Popen(
            ["nice", *qemu_command(image, job)],
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=subprocess.STDOUT,
        )
    try:
        board = EmulatedBoard(process, console, "")
        match = re.search(r"redirected to (\S+) \(label uart\)", board.wait_for("(label uart)", 20.0))
        yield EmulatedBoard(process, console, match[1] if match else "")
    finally:
        process.kill()
        process.wait()


def _drive(name: str, path: Path, option: str) -> str:
    # a comma in a value must be doubled
    return f"if=none,id={name},format=raw,{option},file={str(path).replace(',', ',,')}"
