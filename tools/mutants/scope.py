"""What bugs are planted in, what is traced to find their tests, and what is left out by rule."""

from __future__ import annotations

from pathlib import Path

PYTHON = (
    "simulator/world",
    "simulator/geometry",
    "simulator/camera",
    "simulator/imaging",
    "simulator/labels",
    "simulator/scene",
    "simulator/dataset",
    "hil/link",
    "hil/host",
    "hil/evaluate",
)
"""Folders of Python."""
SHADERS = "shaders"

LEFT_OUT = {
    "hil/evaluate/evaluation_page.py": "how a page looks",
    "hil/evaluate/evaluation_plots.py": "how a plot looks",
    "hil/evaluate/failure_tiles.py": "how a page looks",
    "hil/host/report_plots.py": "how a plot looks",
    "shaders/bench/reference.frag": "measures time; its picture says nothing",
}
"""Files without a right and a wrong that a fast test could tell, and why."""


def files(root: Path) -> tuple[str, ...]:
    """Every file that a bug may be planted in, relative to the root, in order."""
    found = [path for folder in PYTHON for path in (root / folder).rglob("*.py")]
    found += [p for p in (root / SHADERS).rglob("*") if p.suffix in {".glsl", ".vert", ".frag"}]
    names = sorted(path.relative_to(root).as_posix() for path in found)
    return tuple(name for name in names if name not in LEFT_OUT)


def folder_of(name: str) -> str:
    """The folder that a file is counted under."""
    return next((folder for folder in PYTHON if name.startswith(folder + "/")), SHADERS)
