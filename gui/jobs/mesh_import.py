"""Import of a mesh as a target in its own process, by ``flyaround targets add``, while the flight continues."""

from __future__ import annotations

import re
from pathlib import Path

from flyaround.gui.jobs.program import ChildProgram
from flyaround.simulator.targets.importing.read.mesh_file import ENDINGS

MESHES = tuple(f".{ending}" for ending in ENDINGS)
LONGEST_NAME, LONGEST_MISTAKE = 40, 400


class MeshImport(ChildProgram):
    """The import of one mesh.

    Parameters
    ----------
    path : Path
        File of the mesh.

    Raises
    ------
    OSError
        If the process cannot be started.
    """

    def __init__(self, path: Path) -> None:
        self.name = target_name(path.stem)
        super().__init__(("targets", "add", str(path), "--name", self.name, "--no-sheet", "--replace"))

    def update(self) -> str | None:
        """Return the error once the import has ended, empty if there is none; None before."""
        if self.running:
            return None
        code, words = self.exit_code, self.last_error_line()
        self.close()
        return (words or f"it ended with code {code}")[:LONGEST_MISTAKE] if code else ""


def target_name(stem: str) -> str:
    """Return a target's name derived from a file's."""
    return re.sub(r"[^a-z0-9]+", "-", stem.lower()).strip("-")[:LONGEST_NAME] or "mesh"
