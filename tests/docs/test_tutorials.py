"""Each tutorial runs as it stands on its page, and ends where the page says."""

import csv
import json
from pathlib import Path

import pytest
from tutorial import run_tutorial

pytestmark = pytest.mark.gl

PAGES = Path(__file__).parents[2] / "docs" / "tutorials"


@pytest.mark.slow  # tests/flyaround/test_targets_add.py goes the same way
def test_own_mesh(tmp_path):
    printed = run_tutorial(PAGES / "own_mesh.md", tmp_path, {"FLYAROUND_DATA_DIR": str(tmp_path / "targets")})
    assert "6 frames written" in printed
    assert "0 faults" in printed
    card = json.loads((tmp_path / "data" / "dataset.json").read_text())
    assert card["target"]["name"] == "my-satellite"
    assert len(list((tmp_path / "data" / "images").glob("*.mask.png"))) == 6
    assert (tmp_path / "data" / "speed").is_dir()
    assert (tmp_path / "report" / "index.html").exists()


def test_own_board(tmp_path):
    printed = run_tutorial(PAGES / "own_board.md", tmp_path)
    assert "8 frames sent: 8 accepted" in printed
    with (tmp_path / "ledger" / "frames.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["outcome"] for row in rows] == ["accepted"] * 8
    assert (tmp_path / "ledger" / "report.html").exists()


def test_own_flight(tmp_path):
    printed = run_tutorial(PAGES / "own_flight.md", tmp_path)
    assert "phases: cruise" in printed
    assert "inside the keep-out sphere and outside its corridor" in printed
    for name in ("hold", "retreat"):
        assert json.loads((tmp_path / f"{name}.json").read_text())["camera"]["width_px"] == 1920


def test_every_tutorial_is_tested():
    # own_network.md and own_estimator.md need PyTorch: tests/docs/test_own_network.py, test_own_estimator.py
    text = Path(__file__).read_text()
    assert all(page.name in text for page in PAGES.glob("*_*.md"))
