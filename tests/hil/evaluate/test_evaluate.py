"""evaluate and estimate on a captured set: the closed loop from a recipe to metrics.json."""

import csv
import json
import re

import cv2
import jsonschema
import msgspec
import numpy as np
import pytest

from flyaround.__main__ import run
from flyaround.hil.evaluate.evaluation_plots import CAPTIONS
from flyaround.hil.evaluate.failure_stage import KINDS
from flyaround.hil.evaluate.metrics import Metrics
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.recipes.plan import plan_recipe

pytestmark = pytest.mark.gl

N = 2


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder = tmp_path_factory.mktemp("evaluate") / "set"
    capture(plan_recipe("eval-black", N, seed=21), folder)
    return folder


def test_metrics_follow_the_schema_and_the_table(dataset, tmp_path, capsys):
    report = tmp_path / "report"
    methods = ["--method", "svd-thesis", "--method", "svd-2018"]
    assert run(["evaluate", str(dataset), "-o", str(report), *methods, "--json"]) == 0
    metrics = json.loads(capsys.readouterr().out)
    jsonschema.validate(metrics, msgspec.json.schema(Metrics))
    both = list(csv.DictReader((report / "frames.csv").read_text().splitlines()))
    assert len(both) == 2 * N
    assert metrics["by_method"]["svd-2018"]["n"] == N
    rows = [r for r in both if r["method"] == "svd-thesis"]
    assert len(rows) == metrics["n"] == N
    accepted = [r for r in rows if r["accepted"] == "True"]
    feasible = [r for r in rows if r["feasible"] == "True"]
    assert metrics["n_feasible"] == len(feasible)
    assert metrics["n_accepted"] == len(accepted)
    if accepted:
        assert metrics["median_E_R_deg"] == pytest.approx(np.median([float(r["E_R_deg"]) for r in accepted]))

    page = (report / "index.html").read_text()
    shown = re.findall(r'src="([^"]+)"', page)
    assert len(shown) >= len(CAPTIONS)
    for source in shown:
        plot = source.removeprefix("data:image/png;base64,")
        assert (len(plot) if plot != source else (report / source).stat().st_size) > 1000
    # every feasible frame that was missed is put down to one stage
    missed = [r for r in both if r["feasible"] == "True" and not is_coarse(r)]
    assert all(r["failure"] in KINDS for r in missed)
    assert sum(metrics["by_method"]["svd-2018"]["failures"].values()) == sum(
        r["method"] == "svd-2018" for r in missed
    )
    # an interrupted run goes on where it stopped, and comes to the same figures
    lines = (report / "rows.jsonl").read_bytes().splitlines(keepends=True)
    (report / "rows.jsonl").write_bytes(b"".join(lines[:-2]) + lines[-2][:40])
    assert run(["evaluate", str(dataset), "-o", str(report), *methods, "--resume", "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert {k: v for k, v in again.items() if "time" not in k and k != "by_method"} == {
        k: v for k, v in metrics.items() if "time" not in k and k != "by_method"
    }
    # but a folder of something else is left alone
    assert run(["evaluate", str(dataset), "-o", str(report), "--resume"]) == 2
    assert "another evaluation" in capsys.readouterr().err


def is_coarse(row):
    return row["E_R_deg"] != "" and float(row["E_R_deg"]) <= 5 and float(row["e_t"]) <= 0.05


def test_estimate_answers_in_the_machine_read_form(dataset, capsys):
    image = dataset / "images" / "000000.png"
    camera = json.loads((dataset / "images" / "000000.json").read_text())["camera"]
    path = dataset / "camera.json"
    path.write_text(json.dumps(camera))
    assert (
        run(
            [
                *f"estimate {image} --target tango --camera {path} --json --debug".split(),
                str(dataset / "stages"),
            ]
        )
        == 0
    )
    answer = json.loads(capsys.readouterr().out)
    for key in ("accepted", "reason", "q_camera_from_target_wxyz", "t_camera_from_target_m", "confidence"):
        assert key in answer
    assert sum(answer["stages_ms"].values()) > 0
    assert np.shape(answer["covariance"]) == (6, 6)
    names = [p.name[3:-4] for p in sorted((dataset / "stages").glob("[0-9]*"))]
    stages = ["gradient", "histogram", "thresholded", "filtered", "region", "wge_stream", "sh_stream"]
    assert names[:7] == stages
    assert names[-6:] == ["merged", "groups", "learned_proposal", "drawn", "overlay", "camera_in_map"]


def test_an_image_of_real_numbers_is_refused_in_one_sentence(dataset, tmp_path, capsys):
    image = tmp_path / "nan.tiff"
    assert cv2.imwrite(str(image), np.full((40, 60), np.nan, np.float32))
    truth = json.loads((dataset / "images" / "000000.json").read_text())
    camera = tmp_path / "camera.json"
    camera.write_text(json.dumps(truth["camera"]))
    assert run(["estimate", str(image), "--target", "tango", "--camera", str(camera)]) == 2
    assert "float32" in capsys.readouterr().err


def test_another_target_than_the_record_names_is_said(dataset, capsys):
    image = str(dataset / "images" / "000000.png")
    assert run(["estimate", image, "--target", "cubesat-1u"]) == 0
    shown = capsys.readouterr()
    assert "Target cubesat-1u, camera speed." in shown.out
    assert "give --target tango" in shown.err
    assert run(["estimate", image]) == 0
    assert "shows" not in capsys.readouterr().err
