"""The map of where a craft may be: it finds straight-edged things among clouds, and nothing among clouds alone."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from flyaround.hil.board.hybrid.prepare import MAX_BUSY_SHARE
from flyaround.hil.board.hybrid.propose.regions import propose_regions
from flyaround.hil.board.hybrid.propose.saliency import (
    CELL_PX,
    SaliencyWeights,
    boxes,
    saliency_map,
    shipped_weights,
)
from flyaround.hil.board.svd.weak_gradients import eliminate_weak_gradients


@pytest.fixture(scope="module")
def weights() -> SaliencyWeights:
    weights = shipped_weights()
    assert weights is not None
    return weights


def clouds(seed: int) -> np.ndarray:
    """Brightness of scattered clouds: noise of every size, thresholded softly."""
    rng = np.random.default_rng(seed)
    field = np.zeros((300, 480), np.float32)
    for size in (40, 20, 10, 5, 3):
        part = rng.normal(size=(300 // size + 2, 480 // size + 2)).astype(np.float32)
        field += size * cv2.resize(part, (480, 300), interpolation=cv2.INTER_CUBIC)
    return np.clip(25 + 3.0 * np.clip(field - 15, 0, 40) + rng.normal(0, 3, field.shape), 0, 255).astype(
        np.float32
    )


def with_craft(picture: np.ndarray, x: int, y: int) -> np.ndarray:
    """A dark panel with a bright frame and a white box beside it."""
    out = picture.copy()
    cv2.rectangle(out, (x, y), (x + 70, y + 55), 90.0, -1)
    cv2.rectangle(out, (x + 3, y + 3), (x + 67, y + 52), 12.0, -1)
    cv2.rectangle(out, (x + 20, y + 55), (x + 60, y + 80), 210.0, -1)
    noise = np.random.default_rng(3).normal(0, 3, out.shape)
    return np.clip(cv2.GaussianBlur(out, (0, 0), 0.7) + noise, 0, 255).astype(np.float32)


@pytest.mark.parametrize(("x", "y"), [(60, 50), (350, 190), (200, 20)])
def test_one_of_the_boxes_searched_holds_the_craft(weights: SaliencyWeights, x: int, y: int) -> None:
    shares = []
    for box in boxes(saliency_map(with_craft(clouds(1), x, y), 4.0, weights), 2):
        x0, y0, x1, y1 = (CELL_PX * v for v in box)
        inside = max(0, min(x1, x + 70) - max(x0, x)) * max(0, min(y1, y + 80) - max(y0, y))
        shares.append(inside / ((x1 - x0) * (y1 - y0) + 70 * 80 - inside))
    assert max(shares) > 0.33


def test_clouds_alone_are_mostly_left_out(weights: SaliencyWeights) -> None:
    alone, craft = (saliency_map(p, 4.0, weights) for p in (clouds(2), with_craft(clouds(2), 200, 100)))
    assert (alone > 0.5).mean() < 0.1
    assert craft[55:85, 105:130].mean() > 3 * alone[55:85, 105:130].mean()


def test_a_craft_that_fills_the_frame_is_not_taken_for_a_background() -> None:
    noise = np.random.default_rng(4).normal(0, 3, (300, 480))
    near = np.zeros((300, 480), np.float32)
    cv2.rectangle(near, (40, 20), (440, 280), 90.0, -1)
    for x in range(50, 430, 24):
        for y in range(30, 270, 24):
            cv2.rectangle(near, (x, y), (x + 20, y + 20), 25.0, -1)
    near = np.clip(cv2.GaussianBlur(near, (0, 0), 0.7) + 5 + noise, 0, 255).astype(np.float32)
    _, busy, _ = propose_regions(near, eliminate_weak_gradients(near), 3.0)
    assert busy < MAX_BUSY_SHARE
    cloudy = with_craft(clouds(5), 200, 100)
    regions, busy, likely = propose_regions(cloudy, eliminate_weak_gradients(cloudy), 4.0)
    assert busy > MAX_BUSY_SHARE
    assert likely is not None
    assert regions[0].source == "saliency"
