"""What a drawing process keeps: once it has seen a flight, seeing it again and again costs no more memory."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from simulator.camera.lens.camera_model import Camera
from simulator.frame import Frame
from simulator.loop import FrameRequest, OpenRenderer, draw_request
from simulator.runtime.worker import WorkerProcess
from simulator.scenario.load import load_scenario
from simulator.scenario.plan import plan_flight

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


def test_a_drawing_process_keeps_nothing_of_a_frame():
    own = laps("tango-space-10m", 8, 20, SMALL)
    # Programs, buffers of each size and what the C library keeps are there after some laps; what it takes in later
    # steps, and may fill before it takes more, is its own affair and a few MB. What is kept of a frame comes on top of
    # that lap by lap: 64 kB of each are 8 MB here.
    assert own[-1].max() - own[3].max() < 5.0


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["tango-flyaround", "tango-vbar-approach"])
def test_a_whole_flight_seen_again_takes_no_more(scenario):
    own = laps(scenario, 40, 6)
    # at full size the passes' buffers come and go by size class, which the C library cuts a little differently each lap
    assert own[-1].max() - own[2].max() < 5.0
