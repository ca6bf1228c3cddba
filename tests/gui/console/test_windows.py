"""The console in every size: every panel, every scenario, a render process that is lost, mistakes."""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from flyaround.simulator.scenario.load import list_scenarios, load_scenario
from tests.gui.test_window import drawing_process
from tests.harness.screen import virtual_screen, xdotool
from tests.harness.small_disk import small_disk

pytestmark = [pytest.mark.gui, pytest.mark.slow]
TIMEOUT_S = 240.0
SMALLEST, LARGEST = (640, 480), (2560, 1440)


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    with virtual_screen(LARGEST) as name:
        yield name


class Sitting:
    """A console with a script, in a folder of its own; off screen, unless a display is named."""

    def __init__(self, folder: Path, script: str, *options: str, display: str = "") -> None:
        (folder / "script").write_text(script)
        command = [sys.executable, "-m", "flyaround", "-v", "sim", "--json", "--script", "script", *options]
        environment = os.environ | {
            "DISPLAY": display,
            "FLYAROUND_CONSOLE_LAYOUT": str(folder / "layout.json"),
            "COLUMNS": "400",
        }
        if not display:
            command.append("--off-screen")
        self.heard = ""
        self.process = subprocess.Popen(
            command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    def wait_for(self, word: str) -> str:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self.heard += line
            if word in line:
                return line
        pytest.fail(f"the console never said '{word}'")

    def end(self) -> tuple[dict[str, Any], str]:
        out, err = self.process.communicate(timeout=TIMEOUT_S)
        assert self.process.returncode == 0, err
        assert "Traceback" not in err
        return json.loads(out), self.heard + err


def looks(path: Path) -> np.ndarray:
    image = cv2.imread(str(path))
    assert image is not None, path
    return image


def test_every_scenario_is_opened(tmp_path: Path) -> None:
    sitting = Sitting(tmp_path, "600 window.close", "tango-flyaround")
    sitting.wait_for("first picture")
    sitting.process.terminate()
    sitting.process.communicate(timeout=TIMEOUT_S)
    names = list_scenarios()
    lines = [f"{2 + 6 * k} scenario.open {name}" for k, name in enumerate(names)]
    sitting = Sitting(tmp_path, "\n".join([*lines, f"{8 + 6 * len(names)} window.close"]), "tango-flyaround")
    state, said = sitting.end()
    assert state["scenario"] == names[-1]
    assert "could not be opened" not in said
    assert state["pictures"] > len(names)


def test_a_window_is_resized_while_it_flies(display: str, tmp_path: Path) -> None:
    lines = ["6 window.screenshot small.png", "11 window.screenshot large.png", "12 window.close"]
    sitting = Sitting(tmp_path, "\n".join(lines), "tango-flyaround", "--size", "1280x800", display=display)
    sitting.wait_for("first picture")
    window = xdotool(display, "search", "--name", "Flyaround").split()[0]
    time.sleep(2.0)
    xdotool(display, "windowsize", window, *map(str, SMALLEST))
    sitting.wait_for("small.png")
    xdotool(display, "windowsize", window, *map(str, LARGEST))
    sitting.end()
    assert looks(tmp_path / "small.png").shape[:2] == SMALLEST[::-1]
    assert looks(tmp_path / "large.png").shape[:2] == LARGEST[::-1]


def test_recorded_scrubbed_and_flown_on_by_keys(tmp_path: Path) -> None:
    script = (
        "1 hold steer.forward\n3 release steer.forward\n6 timeline.seek 1.5\n7 timeline.fly-on\n"
        "9 timeline.other-future\n10 timeline.end\n11 timeline.keep kept\n20 window.close\n"
    )
    sitting = Sitting(tmp_path, script, "tango-flyaround", "--record", "flown")
    state, said = sitting.end()
    assert "the other future is back" in said
    kept = load_scenario(tmp_path / "kept" / "replay.toml")
    assert kept.duration_s == pytest.approx(6.0, abs=0.3)
    assert load_scenario(tmp_path / state["replay"]).duration_s == pytest.approx(kept.duration_s, abs=0.3)


def test_a_render_process_without_memory_is_told_and_the_flight_goes_on(tmp_path: Path) -> None:
    script = "6 picture.detail full\n8 panel.orbit-camera on\n9 panel.depth on\n40 window.close\n"
    sitting = Sitting(tmp_path, script, "tango-flyaround", "--record", "flown")
    sitting.wait_for("first picture")
    time.sleep(2.0)
    pid = drawing_process(sitting.process.pid)
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[0])
    # what a software driver takes for graphics memory is the process's: no more of it
    limit = pages * resource.getpagesize()
    resource.prlimit(pid, resource.RLIMIT_AS, (limit, limit))
    state, said = sitting.end()
    assert "no picture of the" in said or state["drawing_restarts"] >= 1, said
    assert load_scenario(tmp_path / state["replay"]).duration_s > 30.0


def test_slow_pictures_do_not_slow_the_keys(tmp_path: Path) -> None:
    # whole pictures of the camera, as fine as the scenario asks for: seconds each
    script = "1 picture.detail full\n5 hold steer.forward\n7 release steer.forward\n12 window.close\n"
    state, _ = Sitting(tmp_path, script, "iss-orbit-limb").end()
    assert state["delta_v_m_s"] == pytest.approx(0.1, abs=0.01)
    assert state["window_per_s"] > state["pictures_per_s"]


def test_what_is_typed_ahead_of_a_slow_window_goes_where_it_should(display: str, tmp_path: Path) -> None:
    """Keys and letters that come in one go: none of the letters steers, or saves a picture."""
    sitting = Sitting(tmp_path, "600 window.close", "tango-space-10m", display=display)
    try:
        sitting.wait_for("first picture")
        time.sleep(2.0)
        sitting.process.send_signal(signal.SIGSTOP)
        xdotool(display, "key", "ctrl+p")
        xdotool(display, "type", "--delay", "5", "time.rate 5")
        xdotool(display, "key", "Return")
        xdotool(display, "key", "ctrl+p")
        xdotool(display, "type", "--delay", "5", "no.such pages")
        xdotool(display, "key", "Return")
        sitting.process.send_signal(signal.SIGCONT)
        said = sitting.wait_for("no.such")
        time.sleep(1.0)
        xdotool(display, "key", "ctrl+q")
        state, heard = sitting.end()
    finally:
        sitting.process.kill()
    assert "command" in said
    assert state["rate"] == 5.0
    assert "saved" not in heard


def test_what_goes_wrong_is_told_and_the_flight_goes_on(tmp_path: Path) -> None:
    (tmp_path / "broken.toml").write_text("name = 1")
    (tmp_path / "file").touch()
    script = (
        "1 file.open broken.toml\n2 file.open notes.txt\n3 window.screenshot file/look.png\n"
        "4 film.start file/view.mp4\n5 timeline.keep file\n6 scenario.open nowhere\n"
        "9 window.acknowledge\n10 window.close\n"
    )
    state, said = Sitting(tmp_path, script, "tango-flyaround").end()
    for word in (
        "broken.toml",
        "notes.txt is neither",
        "not saved",
        "cannot write the film",
        "is a file, not a folder",
    ):
        assert word in said, word
    assert state["t_s"] > 5.0


def test_a_full_disk_and_a_folder_that_is_gone_are_told_and_the_flight_goes_on(tmp_path: Path) -> None:
    script = (
        "2 film.start disk/view.mp4\n9 picture.save\n12 window.screenshot disk/look.png\n14 log.save disk/done.script\n"
        "15 timeline.keep disk/kept\n18 film.start gone/view.mp4\n25 film.stop\n26 window.screenshot look.png\n"
        "28 window.close\n"
    )
    with small_disk(tmp_path / "disk", 64) as disk:
        (disk / "other").write_bytes(bytes(52 * 1024))
        (tmp_path / "out").symlink_to(disk)
        sitting = Sitting(tmp_path, script, "tango-flyaround", "--record", "flown")
        sitting.wait_for("first picture")
        sitting.wait_for("gone/view.mp4")
        shutil.rmtree(tmp_path / "gone")
        state, said = sitting.end()
        whole = [p for p in disk.rglob("*") if p.suffix in {".mp4", ".png", ".npz", ".toml"}]
    assert whole == []
    for name in ("view.mp4 is not kept", "not saved: cannot write", "look.png", "flight was not kept"):
        assert name in said, name
    assert said.count("no space left") >= 4
    assert "gone/view.mp4 is not kept" in said
    assert state["t_s"] > 20.0
    assert load_scenario(tmp_path / state["replay"]).duration_s > 20.0
    assert looks(tmp_path / "look.png").std() > 5.0


@pytest.mark.parametrize("version", ["3.0", "3.3"])
def test_a_driver_that_is_too_old_is_one_sentence(display: str, tmp_path: Path, version: str) -> None:
    environment = os.environ | {"DISPLAY": display, "MESA_GL_VERSION_OVERRIDE": version}
    done = subprocess.run(
        [sys.executable, "-m", "flyaround", "sim", "tango-flyaround", "--seconds", "2"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert "OpenGL" in done.stderr
