"""Training samples from labelled images: their keypoints lie on the craft."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest

from flyaround.hil.board.hybrid.propose.keypoints.network_input import INPUT_PX
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.recipes.plan import plan_recipe
from tools.train.captured import pack, read_crops

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.gl
def test_keypoints_of_a_sample_lie_on_the_craft_however_it_is_turned(tmp_path: Path) -> None:
    plan = plan_recipe("eval-black", 4, seed=12)
    capture(plan, tmp_path / "set")
    assert pack(tmp_path / "set") >= 2
    crops = read_crops([tmp_path / "set"])["tango"]
    which = np.repeat(np.arange(len(crops.pictures)), 6)
    batch = crops.sample(which, np.random.default_rng(3))
    assert batch.inputs.shape == (len(which), 2, INPUT_PX, INPUT_PX)
    pixels = np.rint((batch.points + 1) * INPUT_PX / 2 - 0.5).astype(int)
    distances = []
    for brightness, p in zip(batch.inputs[:, 0].astype(float), pixels, strict=True):
        to_craft = cv2.distanceTransform((brightness < 0).astype(np.uint8), cv2.DIST_L2, 5)
        inside = ((p >= 0) & (p < INPUT_PX)).all(axis=1)
        distances += to_craft[p[inside, 1], p[inside, 0]].tolist()
    # some keypoints lie in shadow (2 px here); those of a crop turned the other way lie in empty space (7 px)
    assert np.quantile(distances, 0.9) < 4
