"""flyaround film: what it refuses, the images that it encodes, and what an interrupt leaves."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import av
import pytest

from flyaround.__main__ import run
from flyaround.cli.film import SizedPlan
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--to", "61"], "tango-flyaround lasts 60 s; choose --to within it"),
        (["--from", "5", "--to", "5"], "change --from, --to, --fps or --speed"),
        (["--speed", "10000"], "allowed: 2 to 1000000"),
    ],
)
def test_an_impossible_part_is_refused(words, sentence, tmp_path, capsys):
    assert run(["film", "tango-flyaround", "-o", str(tmp_path / "a.mp4"), *words]) == 2
    assert sentence in " ".join(capsys.readouterr().err.split())
    assert list(tmp_path.iterdir()) == []


def test_the_view_does_not_depend_on_the_size():
    plan = plan_flight(load_scenario("tango-flyaround"), n=2)
    wide, small = SizedPlan(plan, None).scene(1), SizedPlan(plan, 480).scene(1)
    assert (small.camera.width_px, small.camera.height_px) == (480, 300)
    share = small.camera.fx_px / wide.camera.fx_px
    assert share == pytest.approx(480 / wide.camera.width_px)
    assert small.sensor.blur_sigma_px == pytest.approx(share * wide.sensor.blur_sigma_px)


def test_a_film_has_all_images_at_their_times(tmp_path, capsys):
    path = tmp_path / "a.mp4"
    words = ["--width", "96", "--fps", "8", "--speed", "16", "--from", "10", "--to", "30", "--json"]
    assert run(["film", "tango-space-10m", "-o", str(path), *words]) == 0
    assert json.loads(capsys.readouterr().out)["images"] == 11
    with av.open(str(path)) as film:
        times_s = [float(frame.time) for frame in film.decode(video=0)]
    assert times_s == pytest.approx([k / 8 for k in range(11)], abs=2e-3)
    assert (tmp_path / "a.run.toml").is_file()


def test_an_interrupt_leaves_no_file(tmp_path):
    command = [sys.executable, "-P", "-m", "flyaround", "film", "tango-space-10m", "-o", "a.mp4", "--json"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    with subprocess.Popen(
        command,
        cwd=tmp_path,
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
        # a shell starts programs in the background with this signal ignored
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # noqa: PLW1509 - no threads yet
    ) as process:
        assert process.stderr is not None
        assert " of " in process.stderr.readline()
        assert [p.suffix for p in Path(tmp_path).iterdir()] == [".part"]
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    assert process.returncode not in {0, None}
    assert list(tmp_path.iterdir()) == []
