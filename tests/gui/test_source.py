"""Drawing processes may die: others take their place, and the frames go on."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import replace

import pytest

from flyaround.simulator.frame import Frame
from flyaround.simulator.loop import FrameProducer, FrameRequest, open_frames
from flyaround.simulator.runtime.worker import ProcessDiedError
from flyaround.simulator.runtime.worker_pool import MAX_CONSECUTIVE_DEATHS, JobsLostError
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

pytestmark = pytest.mark.gl
TIMEOUT_S = 120.0


def small_request() -> FrameRequest:
    scene = plan_flight(load_scenario("tango-space-10m"), n=1).scene(0)
    camera = replace(scene.camera, width_px=64, height_px=48)
    return FrameRequest(scene=replace(scene, camera=camera, quality="draft"), labels=False)


def next_picture(source: FrameProducer[Frame]) -> Frame:
    until = time.monotonic() + TIMEOUT_S
    while time.monotonic() < until:
        for frame in source.finished():
            return frame
        time.sleep(0.01)
    pytest.fail("no picture came")


def stop(source: FrameProducer[Frame]) -> int:
    """Stop the drawing process where it is, so that it answers nothing more."""
    (pid,) = source.pids
    assert pid is not None
    os.kill(pid, signal.SIGSTOP)
    # one of its threads takes the signal, when it gets a processor
    os.waitid(os.P_PID, pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)
    return pid


def lose_a_picture(source: FrameProducer[Frame], request: FrameRequest) -> None:
    """Ask for a picture of a process that is killed before it can draw it."""
    pid = stop(source)
    assert source.submit(request)
    os.kill(pid, signal.SIGKILL)


def test_pictures_go_on_when_the_process_is_killed() -> None:
    request = small_request()
    with open_frames(Frame.without_radiance, processes=1, restarts=True) as source:
        assert source.submit(request)
        first = next_picture(source)
        dead = source.pids
        lose_a_picture(source, request)
        with pytest.raises(JobsLostError, match=r"died \(exit code -9\) and is restarted"):
            next_picture(source)
        assert source.pids != dead
        assert source.submit(request)
        assert (next_picture(source).image == first.image).all()


def test_pictures_go_on_when_the_process_hangs() -> None:
    request = small_request()
    with open_frames(Frame.without_radiance, processes=1, restarts=True, answer_within_s=5.0) as source:
        assert source.submit(request)
        first = next_picture(source)
        dead = stop(source)
        assert source.submit(request)
        began = time.monotonic()
        with pytest.raises(JobsLostError, match="has done nothing for 5 s and is restarted"):
            next_picture(source)
        assert time.monotonic() - began < TIMEOUT_S
        assert source.pids != (dead,)
        assert source.submit(request)
        assert (next_picture(source).image == first.image).all()


def test_a_process_that_dies_again_and_again_is_given_up() -> None:
    request = small_request()
    with open_frames(Frame.without_radiance, processes=1, restarts=True) as source:
        for death in range(MAX_CONSECUTIVE_DEATHS):
            lose_a_picture(source, request)
            expected = ProcessDiedError if death == MAX_CONSECUTIVE_DEATHS - 1 else JobsLostError
            with pytest.raises(expected):
                next_picture(source)
