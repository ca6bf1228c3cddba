"""The image of a stereo pair in docs/datasets.md.

python -m tools.docs.stereo_picture docs/images/datasets/stereo.jpg
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import msgspec
import numpy as np

from flyaround.simulator.frame import take_frame
from flyaround.simulator.labels.overlay import draw_truth
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.reports.pictures import write_jpeg
from flyaround.simulator.scenario.load import load_recipe
from flyaround.simulator.scene.second_camera import SecondCamera, seen_by_second

SAMPLE, SEED, WIDTH_PX = 3, 11, 960


def main() -> None:
    """Draw both cameras' images of one instant side by side."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("output", type=Path)
    output = parser.parse_args().output
    second = SecondCamera(position_m=(0.4, 0.0, 0.0), turn_deg=(0.0, -2.0, 0.0))
    recipe = load_recipe("eval-earth")
    # short enough for clouds
    sensor = msgspec.structs.replace(recipe.sensor, exposure_s=0.0004)
    recipe = msgspec.structs.replace(recipe, second_camera=second, sensor=sensor)
    plan = plan_recipe(recipe, SAMPLE + 1, seed=SEED)
    first = plan.scene(SAMPLE)
    pictures = []
    with Renderer() as renderer:
        for scene in (first, seen_by_second(first, second)):
            frame = take_frame(renderer, scene, plan.target)
            if frame.truth is None:
                raise RuntimeError("a labelled frame has its truth")
            drawn = draw_truth(frame.image, frame.truth, plan.target)
            step = drawn.shape[1] // WIDTH_PX
            pictures.append(cv2.resize(drawn, None, fx=1 / step, fy=1 / step, interpolation=cv2.INTER_AREA))
    write_jpeg(output, np.concatenate(pictures, axis=1))


if __name__ == "__main__":
    main()
