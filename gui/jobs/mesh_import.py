"""A mesh becomes a target in a process of its own, by ``flyaround targets add``; the flight goes on meanwhile."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from typing import TYPE_CHECKING, NamedTuple

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from pathlib import Path

MESHES = (".glb", ".gltf", ".obj", ".stl")
LONGEST_NAME = 40


class Imported(NamedTuple):
    """How it ended: the target's name, or what is wrong."""

    target: str
    mistake: str


class MeshImport:
    """One mesh at a time.

    Parameters
    ----------
    path : of the mesh.

    Raises
    ------
    UserError
        If the process cannot be started.
    """

    def __init__(self, path: Path) -> None:
        self.name = target_name(path.stem)
        self._told = tempfile.TemporaryFile()  # noqa: SIM115 - closed when the process has ended
        command = [sys.executable, "-m", "flyaround", "targets", "add", str(path), "--name", self.name]
        try:
            self._process = subprocess.Popen(
                [*command, "--no-sheet", "--replace"],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=self._told,
            )
        except OSError as error:
            self._told.close()
            raise UserError(f"the import of {path} could not be started: {error}") from error

    def update(self) -> Imported | None:
        """How it ended, once it has."""
        code = self._process.poll()
        if code is None:
            return None
        with self._told:
            self._told.seek(0)
            lines = self._told.read(65_536).decode(errors="replace").strip().splitlines()
        mistake = "" if code == 0 else (lines[-1] if lines else f"it ended with code {code}")
        return Imported(self.name, mistake[:400])

    def close(self) -> None:
        """Give it up."""
        if self._process.poll() is None:
            self._process.terminate()
        self._process.wait(timeout=10)
        self._told.close()


def target_name(stem: str) -> str:
    """A target's name made of a file's."""
    return re.sub(r"[^a-z0-9]+", "-", stem.lower()).strip("-")[:LONGEST_NAME] or "mesh"
