"""What the estimator costs on this machine: rendered frames, one thread."""

from __future__ import annotations

import cv2
import msgspec

from hil.board.svd import CameraIntrinsics, make_estimator
from hil.evaluate.run import board_model
from simulator.bench.parts import PartCost, cost
from simulator.labels.frame import take_frame
from simulator.loop import plan_flight
from simulator.render.renderer import Renderer
from simulator.scenario_load import load_scenario

SCENARIO = "tango-flyaround"
N_FRAMES = 6


def bench_estimator() -> tuple[PartCost, ...]:
    """Initialisation from single frames along a flight, every stage included."""
    plan = plan_flight(load_scenario(SCENARIO), n=N_FRAMES)
    camera = CameraIntrinsics.from_dict(msgspec.to_builtins(plan.camera))
    estimator = make_estimator(board_model(plan.target), camera)
    with Renderer() as renderer:
        images = [
            take_frame(renderer, plan.scene(k), plan.target, labels=False).image for k in range(N_FRAMES)
        ]
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        results = [estimator.estimate(image) for image in images]
    finally:
        cv2.setNumThreads(threads)
    # the first frame pays for the templates
    return (cost("initialisation, one thread", [sum(r.stages_ms.values()) for r in results[1:]]),)
