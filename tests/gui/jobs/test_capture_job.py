"""A capture beside the flight: a real program, its progress on the disk, its end in a sentence."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from flyaround.gui.jobs.capture_job import CaptureJob, CaptureRequest, pictures_in, thumbnails
from flyaround.gui.jobs.program import ChildProgram
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import new_path

WAIT_S = 180.0


def until(job: CaptureJob, done: Callable[[], bool]) -> str:
    """Turn until something is so; the last sentence that was told."""
    told, end = "", time.monotonic() + WAIT_S
    while not done():
        assert time.monotonic() < end, "it did not come"
        told = job.update() or told
        time.sleep(0.02)
    return told


def test_the_command_line_is_the_one_that_people_type(tmp_path: Path) -> None:
    request = CaptureRequest(
        what="eval-black", frames=5, folder=tmp_path, formats="speed,coco", workers=2, resume=True
    )
    assert " ".join(request.arguments) == (
        f"capture eval-black -o {tmp_path} -n 5 --format speed,coco --workers 2 --resume"
    )


def test_pictures_are_counted_without_their_layers(tmp_path: Path) -> None:
    assert pictures_in(tmp_path / "none") == []
    for place in (tmp_path, tmp_path / "member"):
        (place / "images").mkdir(parents=True)
        for name in ("000001.png", "000000.png", "000000.mask.png", "000000.json", ".000002.png.part"):
            (place / "images" / name).write_bytes(b"")
    assert len(pictures_in(tmp_path)) == 4
    assert pictures_in(tmp_path)[0] == "images/000000.png"


def test_thumbnails_of_any_depth_and_none_of_a_broken_file(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.full((120, 192), 80, np.uint8))
    cv2.imwrite(str(tmp_path / "b.png"), np.full((120, 192, 3), (10, 20, 30), np.uint8))
    cv2.imwrite(str(tmp_path / "c.png"), np.full((120, 192), 4095, np.uint16))
    (tmp_path / "d.png").write_bytes(b"no picture")
    made = thumbnails(tmp_path, ["a.png", "b.png", "c.png", "d.png", "e.png"])
    assert [t.name for t in made] == ["a.png", "b.png", "c.png"]
    assert made[0].image.shape == (125, 200)
    red, green, blue = made[1].image[0, 0].tolist()
    assert red > green > blue > 40  # linear numbers, as a screen shows them
    (tmp_path / "b.json").write_text('{"camera": {"encoding": "srgb"}}')
    assert np.abs(thumbnails(tmp_path, ["b.png"])[0].image[0, 0] - np.array([30.0, 20.0, 10.0])).max() < 6
    assert made[2].image.max() == 255


def test_new_paths_are_numbered(tmp_path: Path) -> None:
    assert new_path(tmp_path, "set") == tmp_path / "set"
    (tmp_path / "set").mkdir()
    assert new_path(tmp_path, "set") == tmp_path / "set-2"


def test_a_mistake_is_the_programs_own_sentence(tmp_path: Path) -> None:
    with contextlib.closing(CaptureJob()) as job:
        job.start(CaptureRequest(what="no-such-thing", frames=3, folder=tmp_path / "set"))
        with pytest.raises(UserError, match="under way"):
            job.start(CaptureRequest(what="tango-flyaround", frames=3, folder=tmp_path / "set"))
        told = until(job, lambda: not job.running)
    assert "no-such-thing" in told
    assert "failed" in told
    assert not (tmp_path / "set").exists()


@pytest.mark.parametrize(
    ("place", "why"), [("/proc/x/y", "cannot write"), ("file/set", "cannot write"), ("", "not empty")]
)
def test_a_folder_that_cannot_be_used_is_refused_at_once(tmp_path: Path, place: str, why: str) -> None:
    (tmp_path / "file").touch()
    with contextlib.closing(CaptureJob()) as job:
        with pytest.raises(UserError, match=why) as caught:
            job.start(CaptureRequest(what="tango-space-10m", frames=1, folder=tmp_path / place))
        assert not job.running
    assert "another folder" in str(caught.value)
    assert "-o" not in str(caught.value).split(";")[-1]


def test_a_program_that_ignores_its_end_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    program = ChildProgram(("scenarios",), lambda: now[0])
    program.stop()
    now[0] = 100.0
    end = time.monotonic() + 20
    while program.running and time.monotonic() < end:
        time.sleep(0.01)
    assert not program.running
    program.close()


@pytest.mark.slow
def test_a_data_set_is_captured_stopped_and_gone_on_with(tmp_path: Path) -> None:
    request = CaptureRequest(what="tango-space-10m", frames=400, folder=tmp_path / "set")
    with contextlib.closing(CaptureJob()) as job:
        job.start(request)
        until(job, lambda: job.done >= 3 and bool(job.thumbnails))
        assert job.left_s is not None
        job.stop()
        told = until(job, lambda: not job.running)
        assert "stopped after" in told
        assert "--resume" in told
        had = job.done
        with pytest.raises(UserError, match="not empty"):
            job.start(CaptureRequest(what="tango-space-10m", frames=400, folder=tmp_path / "set"))
    again = tmp_path / "few"
    with contextlib.closing(CaptureJob()) as job:
        job.start(CaptureRequest(what="tango-space-10m", frames=3, folder=again))
        told = until(job, lambda: not job.running)
        assert told.startswith("captured: 3 frames")
        until(job, lambda: len(job.thumbnails) == 3)
    assert had >= 3


@pytest.mark.slow
def test_a_data_set_whose_folder_is_gone_ends_with_a_sentence(tmp_path: Path) -> None:
    with contextlib.closing(CaptureJob()) as job:
        job.start(CaptureRequest(what="tango-space-10m", frames=400, folder=tmp_path / "disk" / "set"))
        until(job, lambda: job.done >= 2)
        (tmp_path / "disk").rename(tmp_path / "elsewhere")
        (tmp_path / "disk").touch()
        told = until(job, lambda: not job.running)
    assert told.startswith("the capture failed after"), told
    assert "disk/set" in told
    assert "Traceback" not in told
