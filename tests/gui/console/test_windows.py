"""The console in every size: every panel, every scenario, a render process that is lost, mistakes."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from flyaround.simulator.scenario.load import list_scenarios, load_scenario
from tests.gui.test_window import drawing_process, recorded_s
from tests.harness.screen import virtual_screen, xdotool
from tests.harness.sitting import LONGEST_S, Sitting, wait_until
from tests.harness.small_disk import small_disk

pytestmark = [pytest.mark.gui, pytest.mark.slow, pytest.mark.timeout(1800)]
SMALLEST, LARGEST = (640, 480), (2560, 1440)


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    with virtual_screen(LARGEST) as name:
        yield name


def looks(path: Path) -> np.ndarray:
    image = cv2.imread(str(path))
    assert image is not None, path
    return image


def test_every_scenario_is_opened(tmp_path: Path) -> None:
    names = list_scenarios()
    # the operator's time stands until the first picture of each
    lines = [f"{1 + k} scenario.open {name}" for k, name in enumerate(names)]
    script = "\n".join([*lines, f"{1 + len(names)} window.close"])
    with Sitting(tmp_path, "tango-flyaround", script=script) as sitting:
        state, said = sitting.end()
    assert state["scenario"] == names[-1]
    assert "could not be opened" not in said
    assert state["pictures"] > len(names)


def test_a_window_is_resized_while_it_flies(display: str, tmp_path: Path) -> None:
    with Sitting(tmp_path, "tango-flyaround", "--size", "1280x800", display=display) as sitting:
        sitting.wait_for("first picture")
        window = xdotool(display, "search", "--name", "Flyaround").split()[0]
        for size, name in ((SMALLEST, "small.png"), (LARGEST, "large.png")):
            xdotool(display, "windowsize", "--sync", window, *map(str, size))
            sitting.command(f"window.screenshot {name}", f"saved {name}")
        sitting.quit()
    assert looks(tmp_path / "small.png").shape[:2] == SMALLEST[::-1]
    assert looks(tmp_path / "large.png").shape[:2] == LARGEST[::-1]


def test_recorded_scrubbed_and_flown_on_by_keys(display: str, tmp_path: Path) -> None:
    script = (
        "1 hold steer.forward\n3 release steer.forward\n6 timeline.seek 1.5\n7 timeline.fly-on\n"
        "9 timeline.other-future\n10 timeline.end\n11 timeline.keep kept\n"
    )
    options = "tango-flyaround", "--record", "flown"
    with Sitting(tmp_path, *options, script=script, display=display) as sitting:
        sitting.wait_for("the other future is back")
        sitting.wait_for("kept kept")
        state, _ = sitting.quit()
    kept = load_scenario(tmp_path / "kept" / "replay.toml")
    assert kept.duration_s == pytest.approx(6.0, abs=0.3)
    assert load_scenario(tmp_path / state["replay"]).duration_s == pytest.approx(kept.duration_s, abs=0.3)


def test_a_render_process_without_memory_is_told_and_the_flight_goes_on(display: str, tmp_path: Path) -> None:
    with Sitting(tmp_path, "tango-flyaround", "--record", "flown", display=display) as sitting:
        sitting.wait_for("first picture")
        pid = drawing_process(sitting.process.pid)
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[0])
        # what a software driver takes for graphics memory is the process's: no more of it
        limit = pages * resource.getpagesize()
        resource.prlimit(pid, resource.RLIMIT_AS, (limit, limit))
        sitting.command("picture.detail full")
        sitting.command("panel.orbit-camera on")
        sitting.command("panel.depth on", "no picture of the", "is restarted")
        told_s = recorded_s(tmp_path)
        wait_until(lambda: recorded_s(tmp_path) > told_s + 5.0)
        sitting.quit()


def test_slow_pictures_do_not_slow_the_keys(tmp_path: Path) -> None:
    # whole pictures of the camera, as fine as the scenario asks for: seconds each
    script = "1 picture.detail full\n5 hold steer.forward\n7 release steer.forward\n12 window.close\n"
    with Sitting(tmp_path, "iss-orbit-limb", script=script) as sitting:
        state, _ = sitting.end()
    assert state["delta_v_m_s"] == pytest.approx(0.1, abs=0.01)
    assert state["window_per_s"] > state["pictures_per_s"]


def test_what_is_typed_ahead_of_a_slow_window_goes_where_it_should(display: str, tmp_path: Path) -> None:
    """Keys and letters that come in one go: none of the letters steers, or saves a picture."""
    with Sitting(tmp_path, "tango-space-10m", display=display) as sitting:
        sitting.wait_for("first picture")
        sitting.process.send_signal(signal.SIGSTOP)
        sitting.command("time.rate 5")
        sitting.command("no.such pages")
        sitting.process.send_signal(signal.SIGCONT)
        assert "command" in sitting.wait_for("no.such")
        sitting.keys("ctrl+q")
        state, heard = sitting.end()
    assert state["rate"] == 5.0
    assert "saved" not in heard


def test_what_goes_wrong_is_told_and_the_flight_goes_on(display: str, tmp_path: Path) -> None:
    (tmp_path / "broken.toml").write_text("name = 1")
    (tmp_path / "file").touch()
    with Sitting(tmp_path, "tango-flyaround", display=display) as sitting:
        sitting.wait_for("first picture")
        for command, answer in (
            ("file.open broken.toml", "key name is 1"),
            ("file.open notes.txt", "notes.txt is neither"),
            ("window.screenshot file/look.png", "not saved"),
            ("film.start file/view.mp4", "cannot write the film"),
            ("timeline.keep file", "is a file, not a folder"),
            ("scenario.open nowhere", "nowhere"),
        ):
            sitting.command(command, answer)
        sitting.command("window.acknowledge")
        state, _ = sitting.quit()
    assert state["t_s"] > 1.0


def test_a_full_disk_and_a_folder_that_is_gone_are_told_and_the_flight_goes_on(
    display: str, tmp_path: Path
) -> None:
    options = "tango-flyaround", "--record", "flown"
    with small_disk(tmp_path / "disk", 64) as disk, Sitting(tmp_path, *options, display=display) as sitting:
        (disk / "other").write_bytes(bytes(52 * 1024))
        (tmp_path / "out").symlink_to(disk)
        sitting.wait_for("first picture")
        sitting.command("film.start disk/view.mp4", "view.mp4 is not kept")
        sitting.command("picture.save", "not saved: cannot write")
        sitting.command("window.screenshot disk/look.png", "not saved")
        sitting.command("log.save disk/done.script", "no space left", "saved disk/done.script")
        sitting.command("timeline.keep disk/kept", "flight was not kept")
        sitting.command("film.start gone/view.mp4", "gone/view.mp4")
        shutil.rmtree(tmp_path / "gone")
        sitting.command("film.stop", "gone/view.mp4 is not kept")
        sitting.command("window.screenshot look.png", "saved look.png")
        state, said = sitting.quit()
        whole = [p for p in disk.rglob("*") if p.suffix in {".mp4", ".png", ".npz", ".toml"}]
    assert whole == []
    assert said.count("no space left") >= 4
    assert load_scenario(tmp_path / state["replay"]).duration_s == pytest.approx(state["t_s"], abs=0.3)
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
        timeout=LONGEST_S,
        check=False,
    )
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert "OpenGL" in done.stderr
