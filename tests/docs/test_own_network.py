"""The page on training a network, with fewer pictures and steps; needs the extra `train`."""

import csv
import json
from pathlib import Path

import pytest
from tutorial import run_tutorial

pytestmark = [pytest.mark.gl, pytest.mark.slow]

PAGE = Path(__file__).parents[2] / "docs" / "tutorials" / "own_network.md"

SMALLER = {
    "-n 1500": "-n 40",
    "-n 150 ": "-n 4 ",
    "--minutes 6 --threads 2 --width 96 --classes 512": "--steps 4 --classes 128",
    # after four steps all attitudes are equally likely: every frame is declined, for which the host exits with 3
    "-n 6 ": "-n 2 --allow-none ",
}


def test_own_network(tmp_path):
    pytest.importorskip("torch", reason="the extra 'train'")
    text = PAGE.read_text()
    for words, fewer in SMALLER.items():
        assert words in text
        text = text.replace(words, fewer)
    (tmp_path / "page.md").write_text(text)
    printed = run_tutorial(tmp_path / "page.md", tmp_path)
    assert "4 held-out frames" in printed
    assert printed.lower().count("mean predictor") == 2  # by train and by evaluate
    assert "2 frames sent" in printed
    metrics = json.loads((tmp_path / "report" / "metrics.json").read_text())
    assert list(metrics["by_method"]) == ["net:tango.npz"]
    assert metrics["mean_predictor"]["n"] == metrics["n_feasible"]
    with (tmp_path / "ledger" / "frames.csv").open() as table:
        reasons = [row["reason"] for row in csv.DictReader(table)]
    assert reasons == ["several attitudes are equally likely"] * 2
