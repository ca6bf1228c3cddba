"""The contract with scripts: commands, options, exit codes and machine-read fields of `contract.json` still exist.

Additions are free. An entry of the file may only be taken away together with a line in docs/migration.md.
"""

from __future__ import annotations

import csv
import dataclasses
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import typer

from flyaround.__main__ import run
from flyaround.cli.app import app
from flyaround.cli.hil_host import EXIT_NO_ANSWERS
from flyaround.hil.host.ledger.frames_csv import LedgerWriter
from flyaround.schemas import all_schemas
from flyaround.simulator.bench.scenes import BenchMachine, SceneCost

CONTRACT: dict[str, Any] = json.loads(Path(__file__).with_name("contract.json").read_text())


def _find_command(path):
    command: Any = typer.main.get_command(app)
    for name in path.split():
        assert name in command.commands, f"there is no command 'flyaround {path}'"
        command = command.commands[name].make_context(name, [], resilient_parsing=True).command
    return command


@pytest.mark.parametrize("path", CONTRACT["commands"])
def test_command_and_its_options_exist(path):
    options = {o for p in _find_command(path).params for o in [*p.opts, *p.secondary_opts]}
    assert set(CONTRACT["commands"][path]) <= options


@pytest.mark.parametrize("path", CONTRACT["fields"])
def test_documents_have_their_fields(path):
    document, _, definition = path.partition("/")
    schema = all_schemas()[document]
    name = definition or schema["$ref"].rpartition("/")[2]
    assert set(CONTRACT["fields"][path]) <= set(schema["$defs"][name]["properties"])


def test_enumerations_keep_their_values():
    definitions = {name: schema.get("$defs", {}) for name, schema in all_schemas().items()}
    for values, (document, definition, field) in {
        "keypoint_states": ("truth", "KeypointLabel", "state"),
        "distortion_models": ("truth", "Distortion", "model"),
        "closed_loop_outcomes": ("ledger_summary", "ClosedLoopFigures", "outcome"),
    }.items():
        schema = definitions[document][definition]["properties"][field]
        assert set(CONTRACT[values]) <= set(schema["enum"])


def test_the_ledger_has_its_columns(tmp_path):
    LedgerWriter(tmp_path).close()
    with (tmp_path / "frames.csv").open(newline="") as file:
        assert set(CONTRACT["frames_csv"]) <= set(next(csv.reader(file)))


def test_bench_reports_its_fields():
    for part, of in {"machine": BenchMachine, "scenes": SceneCost}.items():
        assert set(CONTRACT["bench"][part]) <= {f.name for f in dataclasses.fields(of)}


def test_estimate_reports_its_fields(tmp_path, capsys):
    camera = {"width_px": 96, "height_px": 64, "fx_px": 90.0, "fy_px": 90.0, "cx_px": 47.5, "cy_px": 31.5}
    (tmp_path / "camera.json").write_text(json.dumps(camera))
    cv2.imwrite(str(tmp_path / "black.png"), np.zeros((64, 96), np.uint8))
    arguments = ["estimate", str(tmp_path / "black.png"), "--camera", str(tmp_path / "camera.json"), "--json"]
    arguments += ["--target", "cubesat-1u"]
    assert run(arguments) == CONTRACT["exit_codes"]["success"]
    answer = json.loads(capsys.readouterr().out)
    assert set(CONTRACT["estimate"]) <= set(answer)
    assert answer["accepted"] is False
    assert answer["network"] is None


def test_estimate_tells_of_a_craft_without_a_network(tmp_path, capsys):
    picture, camera = tmp_path / "dark.png", tmp_path / "camera.json"
    camera.write_text(
        json.dumps(
            {"width_px": 96, "height_px": 64, "fx_px": 90.0, "fy_px": 90.0, "cx_px": 47.5, "cy_px": 31.5}
        )
    )
    cv2.imwrite(str(picture), np.zeros((64, 96), np.uint8))
    arguments = ["estimate", str(picture), "--camera", str(camera), "--target"]
    assert run([*arguments, "cubesat-1u"]) == CONTRACT["exit_codes"]["success"]
    assert "train --craft cubesat-1u" in " ".join("".join(capsys.readouterr()).split())
    # the mock-up has the shape of Tango
    assert run([*arguments, "tango-mockup", "--json"]) == CONTRACT["exit_codes"]["success"]
    assert json.loads(capsys.readouterr().out)["network"] == "tango"


def test_exit_codes(tmp_path):
    codes = CONTRACT["exit_codes"]
    assert run(["scenarios", "--json"]) == codes["success"]
    assert run(["check", str(tmp_path)]) == codes["user_mistake"]
    assert run(["render", "no-such-scenario", "-o", str(tmp_path / "x.png")]) == codes["user_mistake"]
    assert run(["fly", "--no-such-option"]) == codes["user_mistake"]
    assert codes["no_answers"] == EXIT_NO_ANSWERS
    for sent, code in (("SIGINT", codes["interrupted"]), ("SIGTERM", codes["terminated"])):
        # what runs in the background is started with Ctrl-C ignored
        stop = (
            "import os, signal, flyaround.cli.app as c, flyaround.__main__ as m; "
            "signal.signal(signal.SIGINT, signal.default_int_handler); c.app = lambda **_: "
            f"(os.kill(os.getpid(), signal.{sent}), signal.pause()); m.main()"
        )
        done = subprocess.run([sys.executable, "-c", stop], capture_output=True, timeout=200, check=False)
        assert done.returncode == code
