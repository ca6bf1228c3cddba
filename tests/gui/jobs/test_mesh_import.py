"""A mesh that is dropped on the window."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from flyaround.gui.jobs.mesh_import import MeshImport, target_name


def ended(job: MeshImport) -> str:
    until = time.monotonic() + 60.0
    while time.monotonic() < until:
        if (mistake := job.update()) is not None:
            return mistake
        time.sleep(0.05)
    pytest.fail("the import did not end")


def test_names_of_targets() -> None:
    assert target_name("My Satellite (v2)") == "my-satellite-v2"
    assert target_name("___") == "mesh"


def test_what_is_no_mesh_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "broken.glb"
    path.write_bytes(b"not a mesh")
    job = MeshImport(path)
    assert job.name == "broken"
    mistake = ended(job)
    assert "broken.glb" in mistake
    assert "Traceback" not in mistake
