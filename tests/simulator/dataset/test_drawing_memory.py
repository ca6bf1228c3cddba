"""What a drawing process keeps: once it has seen a flight, seeing it again and again costs no more memory."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.frame import Frame
from flyaround.simulator.loop import FrameRequest, OpenRenderer, draw_request
from flyaround.simulator.runtime.worker import WorkerProcess
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

pytestmark = [
    pytest.mark.gl,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc/self/status"),
]

SMALL = Camera(width_px=480, height_px=300, fx_px=750.0, fy_px=750.0, cx_px=239.5, cy_px=149.5)


def draw(renderer, scene):
    """A frame as a stream gets it, and what the process has of its own in memory [MB]."""
    frame = draw_request(renderer, FrameRequest(scene=scene), Frame.image_and_truth)
    status = Path("/proc/self/status").read_text()
    own = next(line for line in status.splitlines() if line.startswith("RssAnon"))
    return frame.image, int(own.split()[1]) / 1024


def laps(scenario, n_frames, count, camera=None):
    """Memory after each frame of a process of its own that draws the same moments lap by lap, (laps, frames) [MB]."""
    plan = plan_flight(load_scenario(scenario), n=n_frames)
    scenes = [plan.scene(k) for k in range(n_frames)]
    if camera is not None:
        scenes = [replace(scene, camera=camera) for scene in scenes]
    own = []
    with WorkerProcess(draw, open_resource=OpenRenderer(first=scenes[0]), capacity=2) as process:
        for scene in scenes * count:
            if not process.has_room:
                own.append(process.result()[1])
            process.submit(scene)
        own += [result[1] for result in process.results()]
    return np.array(own).reshape(count, n_frames)


def rise_of_a_lap(own, first):
    """How much the laps from ``first`` on take more than the one before, in the middle [MB].

    Programs, buffers of each size and what the C library keeps are there after some laps. It takes more in steps, one
    in a dozen laps: what is kept of a frame comes on top of that lap by lap.
    """
    return float(np.median(np.diff(own[first:].max(axis=1))))


def test_a_drawing_process_keeps_nothing_of_a_frame():
    # 64 kB of each frame would be 0.5 MB a lap
    assert rise_of_a_lap(laps("tango-space-10m", 8, 20, SMALL), 3) < 0.25


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["tango-flyaround", "tango-vbar-approach"])
def test_a_whole_flight_seen_again_takes_no_more(scenario):
    # the same would be 2.5 MB
    assert rise_of_a_lap(laps(scenario, 40, 8), 2) < 0.5
