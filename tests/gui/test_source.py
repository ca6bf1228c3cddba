"""The console's render process may die: another takes its place, and the pictures go on."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import replace

import pytest

from gui.feed import PicturesLostError
from gui.source import MOST_DEATHS, RenderedPictures
from simulator.errors import UserError
from simulator.frame import Frame
from simulator.loop import plan_flight
from simulator.scenario.load import load_scenario
from simulator.scene.state import SceneState

pytestmark = pytest.mark.gl
TIMEOUT_S = 120.0


def small_scene() -> SceneState:
    scene = plan_flight(load_scenario("tango-space-10m"), n=1).scene(0)
    camera = replace(scene.camera, width_px=64, height_px=48)
    return replace(scene, camera=camera, quality="draft")


def next_picture(source: RenderedPictures) -> Frame:
    until = time.monotonic() + TIMEOUT_S
    while time.monotonic() < until:
        for frame in source.results():
            return frame
        time.sleep(0.01)
    pytest.fail("no picture came")


def kill(source: RenderedPictures) -> None:
    assert source.pid is not None
    os.kill(source.pid, signal.SIGKILL)


def test_pictures_go_on_when_the_process_is_killed() -> None:
    scene = small_scene()
    with RenderedPictures() as source:
        assert source.submit(scene)
        first = next_picture(source)
        dead = source.pid
        assert source.submit(scene)
        kill(source)
        with pytest.raises(PicturesLostError, match=r"died \(exit code -9\) and is started again"):
            next_picture(source)
        assert source.pid != dead
        assert source.submit(scene)
        assert (next_picture(source).image == first.image).all()


def test_a_process_that_dies_again_and_again_is_given_up() -> None:
    scene = small_scene()
    with RenderedPictures() as source:
        for death in range(MOST_DEATHS):
            assert source.submit(scene)
            kill(source)
            expected = UserError if death == MOST_DEATHS - 1 else PicturesLostError
            with pytest.raises(expected):
                next_picture(source)
