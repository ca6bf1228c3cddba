"""Figure of captured images with the craft's axes in docs/datasets.md, after figure 1 of the data-set paper.

python -m tools.docs.axes_picture docs/images/datasets/axes.jpg
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import cv2
import numpy as np

from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.labelled_dataset import open_dataset
from flyaround.simulator.dataset.overlays import overlay
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.reports.pictures import write_jpeg

SEED, WIDTH_PX = 4, 640  # seed of the captures, and width of the figure's tiles
SAMPLES = {"paper-dragon": 33, "paper-soyuz": 19, "paper-tianzhou": 8, "paper-change6": 6}
"""Sample of each recipe in which the craft is near, completely visible and sunlit."""


def main() -> None:
    """Capture a few images of each craft and draw the axes of one of them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("output", type=Path)
    output = parser.parse_args().output
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        for name, sample in SAMPLES.items():
            plan = plan_recipe(name, sample + 1, seed=SEED)
            capture(plan, Path(folder) / name)
            drawn = overlay(open_dataset(Path(folder) / name)[sample], plan.target, ("axes",))
            size = (WIDTH_PX, round(WIDTH_PX * drawn.shape[0] / drawn.shape[1]))
            pictures.append(cv2.resize(drawn, size, interpolation=cv2.INTER_AREA))
    write_jpeg(output, np.vstack([np.hstack(pictures[:2]), np.hstack(pictures[2:])]))


if __name__ == "__main__":
    main()
