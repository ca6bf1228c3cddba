"""Board bundle: agent, estimators, link, pyserial and board models in one executable Python zip."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import zipfile
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

import flyaround.hil
from flyaround.hil.board.hybrid.native.library import CHECKSUMS
from flyaround.hil.board.hybrid.propose.keypoints.network import SHARED_HEADS
from flyaround.hil.board_model.write import board_record
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from flyaround.simulator.targets.model import Target

# Run by `python3 board.pyz`; the zip is its own import path.
MAIN = b'from flyaround.hil.board.__main__ import run_and_exit\n\nrun_and_exit("board.pyz")\n'

SHEBANG = b"#!/usr/bin/env python3\n"

# Earliest date of a zip file, used for all members so that the same sources give the same bytes.
DATE = (1980, 1, 1, 0, 0, 0)

# Folder of the keypoint network's weights: the trunk, and one head per target.
WEIGHTS = "weights"

# Parts of pyserial that a Linux board never imports.
EXCLUDED = (
    "tools",
    "threaded",
    "urlhandler",
    "rfc2217.py",
    "serialjava.py",
    "serialcli.py",
    "serialwin32.py",
    "win32.py",
)


def write_bundle(path: Path, targets: Sequence[Target]) -> int:
    """Write the bundle with the board models of ``targets``, as an executable file.

    On the board it needs only Python 3.9, NumPy and OpenCV 4.6.

    Returns
    -------
    int
        Size of the bundle [bytes].

    Raises
    ------
    UserError
        If pyserial is not installed here, or the file cannot be written.
    """
    data = BytesIO()
    data.write(SHEBANG)
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as bundle:
        for name, content in sorted(_contents(targets)):
            bundle.writestr(zipfile.ZipInfo(name, DATE), content, zipfile.ZIP_DEFLATED)
    write_atomic(path, data.getvalue())
    path.chmod(0o755)
    return len(data.getvalue())


def _contents(targets: Sequence[Target]) -> Iterator[tuple[str, bytes]]:
    yield "__main__.py", MAIN
    yield "flyaround/__init__.py", b""  # the real package needs a newer Python
    root = Path(flyaround.hil.__path__[0])
    for source in (root / "__init__.py", *(root / "board").rglob("*.py"), *(root / "link").rglob("*.py")):
        # debug images are not needed for estimation
        if source.parent.name != "debug":
            yield f"flyaround/hil/{source.relative_to(root).as_posix()}", source.read_bytes()
    names = {SHARED_HEADS.get(target.name, target.name) for target in targets}
    for kind in ("*.npz", "trunk.onnx", "kernels.h", "linux-*.so", CHECKSUMS):
        for data in (root / "board").rglob(kind):
            # only the heads of the bundled targets
            if WEIGHTS not in data.parts or data.stem in names or data.stem == "trunk":
                yield f"flyaround/hil/{data.relative_to(root).as_posix()}", data.read_bytes()
    for target in targets:
        yield (
            f"flyaround/hil/board/models/{target.name}.board.json",
            msgspec.json.encode(board_record(target)),
        )
    # pyserial is pure Python, so the board needs no package installation
    spec = importlib.util.find_spec("serial")
    if spec is None or spec.origin is None:
        raise UserError("the bundle includes pyserial, which is not installed here: pip install pyserial")
    serial = Path(spec.origin).parent
    for source in serial.rglob("*.py"):
        inner = source.relative_to(serial)
        if inner.parts[0] not in EXCLUDED:
            yield f"serial/{inner.as_posix()}", source.read_bytes()
    notice = importlib.metadata.metadata("pyserial")
    yield (
        "serial/NOTICE.txt",
        f"pyserial {notice['Version']}, {notice['License']}, {notice['Home-page']}\n".encode(),
    )
