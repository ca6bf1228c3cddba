"""Files that version 0.1 wrote (tests/data/v0.1) give today what they gave then, by the commands that users type."""

import csv
import json
import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

import flyaround as fa
from flyaround.__main__ import run
from flyaround.gui.app import command_table, options_of
from flyaround.gui.console import Console
from flyaround.gui.picture.feed import Feed
from flyaround.gui.script import Script
from flyaround.hil.link.security import read_key
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.faults import read_faults
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.targets.library import load_target
from tests.harness.no_renderer import NoRenderer

V01 = Path(__file__).parents[1] / "data" / "v0.1"
OF_GUIDANCE = ("phase", "thrust", "mass", "delta_v", "events")
"""Beginnings of the columns that a replayed flight leaves empty."""


@pytest.fixture
def v01(tmp_path):
    """Return a copy of the files, which commands may write to."""
    return Path(shutil.copytree(V01, tmp_path / "v0.1"))


@pytest.fixture
def type_in(capsys):
    """Return a function that runs a command line and gives its exit code, output and messages."""

    def type_in(*words):
        code = run([str(word) for word in words])
        said = capsys.readouterr()
        return code, said.out, " ".join(said.err.split())

    return type_in


def _rows(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def _assert_same_rows(found, expected, columns):
    assert len(found) == len(expected)
    for row, wanted in zip(found, expected, strict=True):
        for name in columns:
            try:
                assert float(row[name]) == pytest.approx(float(wanted[name]), rel=1e-9, abs=1e-6), name
            except ValueError:
                assert row[name] == wanted[name], name


def _angle_deg(q_wxyz, other_wxyz):
    return np.degrees(2.0 * np.arccos(min(1.0, abs(float(np.dot(q_wxyz, other_wxyz))))))


@pytest.mark.parametrize(
    ("scenario", "expected", "every_s"),
    [
        ("scenario.toml", "flight", 90),  # printed by scenarios --show, with thrusters and a keep-out
        ("flight/replay.toml", "flight", 90),  # recorded by fly --record
        ("oem/oem.toml", "oem", 20),  # an ephemeris of fly --oem
    ],
)
def test_a_scenario_flies_the_same_states(type_in, tmp_path, scenario, expected, every_s):
    code, _, said = type_in("fly", V01 / scenario, "-o", tmp_path / "flown", "--every", every_s)
    assert code == 0, said
    wanted = _rows(V01 / expected / "states.csv")
    replayed = "replay" in scenario
    columns = [name for name in wanted[0] if not (replayed and name.startswith(OF_GUIDANCE))]
    _assert_same_rows(_rows(tmp_path / "flown" / "states.csv"), wanted, columns)


def test_a_recipe_draws_the_same_samples(type_in, tmp_path):
    code, _, said = type_in("recipes", V01 / "recipe.toml", "--samples", tmp_path / "s.csv", "-n", 4)
    assert code == 0, said
    wanted = _rows(V01 / "samples.csv")
    _assert_same_rows(_rows(tmp_path / "s.csv"), wanted, wanted[0])


def test_a_console_script_flies_to_the_same_end():
    end = json.loads((V01 / "console_end.json").read_text())
    session, table = FlightSession.of(load_scenario(V01 / "session.toml")), command_table()
    console = Console(session, Feed(NoRenderer()), options_of(session), table)
    console.play(Script.read(V01 / "console.script", table))
    operator_ms = round(1000 * end["operator_s"])
    while console.clock_ms < operator_ms:
        console.pass_time(min(40, operator_ms - console.clock_ms))
    world = session.craft.world
    assert session.t_s == pytest.approx(end["t_s"])
    np.testing.assert_allclose(world.position_lvlh_m, end["position_lvlh_m"], atol=1e-6)
    np.testing.assert_allclose(world.velocity_lvlh_m_s, end["velocity_lvlh_m_s"], atol=1e-8)
    assert session.craft.steering.propellant.delta_v_m_s == pytest.approx(end["delta_v_m_s"])


def test_a_campaign_goes_on_with_the_same_values(type_in, v01):
    result = v01 / "campaign" / "runs" / "late" / "seed-1" / "result.json"
    wanted = json.loads(result.read_text())["values"]
    code, out, said = type_in("hil", "campaign", v01 / "campaign.toml", "-o", v01 / "campaign", "--json")
    assert code == 0, said
    assert "1 run of case 'late' had another version and is repeated" in said
    outcome = json.loads(out)
    assert [r["runs_passed"] for r in outcome["requirements"]] == [1, 1]
    found = json.loads(result.read_text())["values"]
    numbers = {name for name, value in wanted.items() if isinstance(value, float)}
    assert {n: found[n] for n in wanted if n not in numbers} == {
        n: wanted[n] for n in wanted if n not in numbers
    }
    assert [found[n] for n in numbers] == pytest.approx([wanted[n] for n in numbers], rel=1e-6, abs=1e-6)


def test_a_runs_folder_is_reported(type_in, v01):
    code, _, said = type_in("hil", "report", v01 / "run")
    assert code == 0, said
    page = (v01 / "run" / "report.html").read_text()
    assert "4 sent = 0 accepted + 4 declined + 0 dropped" in page
    assert "stuck_pixels" in page
    for name in ("frames.csv", "summary.json", "run.json"):
        assert (v01 / "run" / name).read_bytes() == (V01 / "run" / name).read_bytes()


def test_a_faults_file_and_a_key_are_read(tmp_path):
    faults = read_faults(V01 / "faults.toml")
    assert faults.seed == 9
    assert [fault.share for fault in faults.camera] == [0.002]
    assert len(faults.line) == 2
    # a checkout does not keep that only its owner may read a key
    key = tmp_path / "key"
    key.write_bytes((V01 / "key").read_bytes())
    key.chmod(0o600)
    assert read_key(str(key)) == key.read_bytes().strip()


def test_an_added_target_is_the_same(monkeypatch):
    monkeypatch.setenv("FLYAROUND_DATA_DIR", str(V01))
    target = load_target("box-v01")
    assert target.sha256 == "8523afcd1f9379885293e9f68de3e854882e38ad8088edd43cb87f90d759f807"
    assert len(target.keypoints) == 8


@pytest.mark.gl
def test_a_data_set_passes_check(type_in):
    wanted = json.loads((V01 / "check.json").read_text())
    code, out, said = type_in("check", V01 / "dataset", "--redraw", 1, "--json")
    found = json.loads(out)
    assert (code, found["faults"]) == (0, []), said
    assert {name: found[name] for name in ("frames", "labels", "redrawn")} == {
        name: wanted[name] for name in ("frames", "labels", "redrawn")
    }
    # how planned scenes and exports are written has changed
    assert len(found["not_checked"]) == 2
    assert all("another version, flyaround 0.1.0" in reason for reason in found["not_checked"])


def test_a_data_set_opens_and_another_version_does_not_go_on_in_it(type_in, v01):
    words = ("capture", v01 / "recipe.toml", "-n", 4, "--camera", v01 / "camera.json", "--labels", "all")
    code, _, said = type_in(*words, "--format", "speed", "-o", v01 / "dataset", "--resume")
    assert code == 2
    assert "was captured with flyaround 0.1.0" in said
    assert "name a new folder" in said
    samples = list(fa.open_dataset(v01 / "dataset"))
    assert len(samples) == 4
    for k, sample in enumerate(samples):
        record = json.loads((V01 / "dataset" / "images" / f"{k:06d}.json").read_text())
        assert sample.truth.t_camera_from_target_m == tuple(record["t_camera_from_target_m"])
        picture = cv2.imread(str(V01 / "dataset" / "images" / f"{k:06d}.png"), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(sample.image, picture)


def test_a_report_of_evaluate_goes_on_and_has_the_same_figures(type_in, v01):
    code, out, said = type_in("evaluate", v01 / "dataset", "-o", v01 / "report", "--resume", "--json")
    assert code == 0, said
    found, wanted = json.loads(out), json.loads((V01 / "report" / "metrics.json").read_text())
    names = [name for name, value in wanted.items() if isinstance(value, int | float)]
    assert {name: found[name] for name in names} == pytest.approx({name: wanted[name] for name in names})


def test_the_estimate_of_a_picture_is_the_same(type_in):
    wanted = json.loads((V01 / "estimate.json").read_text())
    picture, camera = V01 / "dataset" / "images" / "000003.png", V01 / "camera.json"
    code, out, said = type_in("estimate", picture, "--camera", camera, "--json")
    assert code == 0, said
    found = json.loads(out)
    assert found["accepted"] == wanted["accepted"]
    np.testing.assert_allclose(found["t_camera_from_target_m"], wanted["t_camera_from_target_m"], atol=0.02)
    assert _angle_deg(found["q_camera_from_target_wxyz"], wanted["q_camera_from_target_wxyz"]) < 0.5


@pytest.mark.gl
def test_a_truth_record_draws_the_same_picture(type_in, tmp_path):
    code, _, said = type_in("render", "--from-truth", V01 / "truth.json", "-o", tmp_path / "again.png")
    assert code == 0, said
    # its Earth and its light were mended since, so the pixels differ; where the target is does not
    old, new = (json.loads(f.read_text()) for f in (V01 / "truth.json", tmp_path / "again.json"))
    for name in ("mask_sha256", "box_px", "q_camera_from_target_wxyz", "t_camera_from_target_m"):
        assert new[name] == old[name], name
    left, top, right, bottom = (round(edge) for edge in old["box_px"])
    craft = [
        cv2.imread(str(f), cv2.IMREAD_UNCHANGED)[top:bottom, left:right].astype(float)
        for f in (V01 / "truth.png", tmp_path / "again.png")
    ]
    assert np.corrcoef(*(image.ravel() for image in craft))[0, 1] > 0.9


def test_an_old_board_serves_a_new_host(type_in, v01):
    pictures = v01 / "pictures"
    pictures.mkdir()
    shutil.copy(v01 / "truth.png", pictures)
    with socket.create_server(("127.0.0.1", 0)) as free:
        url = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    # a copy of the key that nobody else may read, as `hil key` writes it
    (v01 / "key").chmod(0o600)
    # a busy machine may keep either side silent for long
    both = ["--key", str(v01 / "key"), "--silence", "60"]
    board = [
        sys.executable,
        str(v01 / "board.pyz"),
        url,
        "--model",
        "tango-mli",
        "--method",
        "svd-2018",
        *both,
    ]
    environment = {name: text for name, text in os.environ.items() if name != "PYTHONPATH"}
    with subprocess.Popen(board, env=environment, stderr=subprocess.PIPE, text=True) as process:
        try:
            host = ["hil", "host", v01 / "session.toml", "--from", pictures, "-n", 2, "--listen", url, *both]
            code, out, said = type_in(*host, "--log", v01 / "log", "--truth", "off", "--allow-none", "--json")
            assert code == 0, said
            # the board says goodbye and exits with 0
            assert process.wait(timeout=60.0) == 0
        finally:
            process.kill()
    summary = json.loads(out)
    assert (summary["sent"], summary["dropped"], summary["protocol_version"]) == (2, {}, 2)
    assert summary["link"]["mistakes"] == {}
    found, wanted = _rows(v01 / "log" / "frames.csv"), _rows(V01 / "answers.csv")
    for row, old in zip(found, wanted, strict=True):
        assert (row["outcome"], row["reason"]) == (old["outcome"], old["reason"])
        q, q_old = ([float(r[f"q_{a}"]) for a in "wxyz"] for r in (row, old))
        assert _angle_deg(q, q_old) < 0.5
        assert float(row["t_z_m"]) == pytest.approx(float(old["t_z_m"]), abs=0.05)
