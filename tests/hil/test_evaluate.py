"""evaluate and estimate on a captured set: the closed loop from a recipe to metrics.json."""

import csv
import json

import jsonschema
import numpy as np
import pytest

from flyaround.__main__ import run
from hil.evaluate.metrics import metrics_json_schema
from simulator.dataset.capture import capture
from simulator.recipe import plan_recipe

pytestmark = pytest.mark.gl

N = 4


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder = tmp_path_factory.mktemp("evaluate") / "set"
    capture(plan_recipe("eval-black", N, seed=21), folder)
    return folder


def test_metrics_follow_the_schema_and_the_table(dataset, tmp_path, capsys):
    report = tmp_path / "report"
    assert run(["evaluate", str(dataset), "-o", str(report), "--json"]) == 0
    metrics = json.loads(capsys.readouterr().out)
    jsonschema.validate(metrics, metrics_json_schema())
    rows = list(csv.DictReader((report / "frames.csv").read_text().splitlines()))
    assert len(rows) == metrics["n"] == N
    accepted = [r for r in rows if r["accepted"] == "True"]
    feasible = [r for r in rows if r["feasible"] == "True"]
    assert metrics["n_feasible"] == len(feasible)
    assert metrics["n_accepted"] == len(accepted)
    if accepted:
        assert metrics["median_E_R_deg"] == pytest.approx(np.median([float(r["E_R_deg"]) for r in accepted]))


def test_estimate_answers_in_the_machine_read_form(dataset, capsys):
    image = dataset / "images" / "000000.png"
    camera = json.loads((dataset / "images" / "000000.json").read_text())["camera"]
    path = dataset / "camera.json"
    path.write_text(json.dumps(camera))
    assert run(["estimate", str(image), "--target", "tango", "--camera", str(path), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    for key in ("accepted", "reason", "q_camera_from_target_wxyz", "t_camera_from_target_m", "confidence"):
        assert key in answer
    assert sum(answer["stages_ms"].values()) > 0
