"""Thumbnails of the console's scenario chooser: ``python -m tools.docs.scenario_pictures``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2

from flyaround.simulator.imaging.display import display_picture
from flyaround.simulator.loop import run_frames
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.scenario.load import list_scenarios, load_scenario
from flyaround.simulator.scenario.plan import plan_flight

FOLDER = Path("assets") / "scenarios"
WIDTH_PX, JPEG_QUALITY = 240, 82  # width of a thumbnail, and its JPEG quality
MIDDLE = 0.4
"""Share of the flight after which the image is taken."""
OTHERWISE = {"tango-eclipse-pass": 0.05}
"""Scenarios with another share of the flight, at which they show more."""


def main() -> None:
    """Write a thumbnail of each built-in scenario next to its file."""
    with Renderer() as renderer:
        for name in list_scenarios():
            scenario = load_scenario(name)
            plan = plan_flight(
                scenario, times=(OTHERWISE.get(name, MIDDLE) * scenario.duration_s,), bands="rgb"
            )
            plan = replace(plan, camera=plan.camera.resized(2 * WIDTH_PX))
            frame = next(iter(run_frames(plan, renderer, labels=False)))
            scene = frame.scene
            image = display_picture(frame.image, scene.sensor, scene.camera.pixel_encoding)
            height = round(image.shape[0] * WIDTH_PX / image.shape[1])
            small = cv2.resize(image, (WIDTH_PX, height), interpolation=cv2.INTER_AREA)
            ok, data = cv2.imencode(
                ".jpg", cv2.cvtColor(small, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
            )
            if not ok:
                raise RuntimeError(f"the picture of {name} could not be encoded")
            write_atomic(FOLDER / f"{name}.jpg", data.tobytes())


if __name__ == "__main__":
    main()
