"""The page on training an estimator for one's own mesh, with fewer views and steps; needs the extra `train`."""

import json
from pathlib import Path

import pytest
import trimesh
from tutorial import run_tutorial

pytestmark = [pytest.mark.gl, pytest.mark.slow]

PAGE = Path(__file__).parents[2] / "docs" / "tutorials" / "own_estimator.md"

SMALLER = {"--minutes 20 --threads 2": "--views 30 --steps 4 --calibrate 8", "-n 40 ": "-n 3 "}


def test_own_estimator(tmp_path):
    pytest.importorskip("torch", reason="the extra 'train'")
    parts = [
        trimesh.creation.box((0.8, 0.6, 0.5)),
        trimesh.creation.box((1.8, 0.02, 0.4), trimesh.transformations.translation_matrix((0.3, 0, 0.15))),
    ]
    trimesh.util.concatenate(parts).export(tmp_path / "satellite.obj")
    text = PAGE.read_text()
    for words, fewer in SMALLER.items():
        assert words in text
        text = text.replace(words, fewer)
    (tmp_path / "page.md").write_text(text)
    printed = run_tutorial(tmp_path / "page.md", tmp_path, {"FLYAROUND_DATA_DIR": str(tmp_path / "data")})
    assert "4 steps on 30 views" in printed
    assert (tmp_path / "data" / "targets" / "my-craft.keypoints.npz").is_file()
    assert json.loads((tmp_path / "report" / "metrics.json").read_text())["n"] == 3
    assert (tmp_path / "board.pyz").stat().st_size > 6_000_000
