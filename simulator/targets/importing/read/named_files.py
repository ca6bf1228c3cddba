"""Files that a model refers to (textures, material libraries), searched in the model's folder."""

from __future__ import annotations

import re
from pathlib import Path, PureWindowsPath

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import find_beside, read_regular

_LINE_END = re.compile(r"\r\n?")
_LINE_CONTINUATION = re.compile(r"\\[ \t]*\n")


class NotReadError(Exception):
    """A file that the model refers to is missing or unreadable; the message names it and the reason, without a path."""


def text_lines(data: bytes) -> list[str]:
    """Return the lines of an OBJ or MTL file in UTF-8, UTF-16 or Windows-1252, with any line ends."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = data.decode("utf-16", "replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("cp1252", "replace")
    return _LINE_CONTINUATION.sub(" ", _LINE_END.sub("\n", text)).split("\n")


def split_word(line: str) -> tuple[str, str]:
    """Return the first word of a line and the rest without surrounding white space."""
    word, *rest = line.split(None, 1) or [""]
    return word, rest[0].strip() if rest else ""


def unquoted(name: str) -> str:
    """Return a name without the pair of quotes around it, if any."""
    quote = name[:1]
    return name[1:-1].strip() if quote in ("'", '"') and name.find(quote, 1) == len(name) - 1 > 0 else name


def read_named(model: Path, owner: Path, name: str, what: str, max_bytes: int) -> tuple[Path, bytes]:
    """Find and read a file to which ``owner`` refers.

    Exporters often write absolute paths of their own machine. If there is no such file, the file of the same name
    beside ``owner`` is read. Case is ignored if no file matches exactly.

    Parameters
    ----------
    model : Path
        Path of the model. Files outside its folder are not read.
    owner : Path
        Path of the file that contains the reference.
    name : str
        Name as written in ``owner``.
    what : str
        Kind of file, for the message.
    max_bytes : int
        Size above which the file is not read.

    Raises
    ------
    NotReadError
        If the file is missing, outside the model's folder, not a regular file, or too large.
    """
    first: UserError | None = None
    for candidate in dict.fromkeys((name, PureWindowsPath(name).name)):
        if not candidate:
            continue
        try:
            path = _ignoring_case(find_beside(owner, candidate, what, model.parent))
            return path, read_regular(path, max_bytes)
        except UserError as error:
            first = first or error
        except OSError:
            first = first or UserError(
                f"{owner}: {what} file {name[:80]!r} is missing; put it beside the model"
            )
    raise NotReadError(str(first or f"{what} file without a name").removeprefix(f"{owner}: "))


def _ignoring_case(path: Path) -> Path:
    """Return the file of this name, or the one whose name differs in case only."""
    if path.exists() or not path.parent.is_dir():
        return path
    folded = path.name.casefold()
    return next((p for p in sorted(path.parent.iterdir()) if p.name.casefold() == folded), path)
