"""Which pixels a check asks about: every part once, however few pixels it has."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from flyaround.simulator.dataset.check.sampled_rays import sample_pixels


@pytest.mark.parametrize("rolling", [False, True])
def test_every_part_is_asked_about_once_though_it_be_a_pixel(*, rolling: bool) -> None:
    mask = np.zeros((400, 400), np.uint8)
    mask[50:350, 50:350] = 255
    parts = np.where(mask > 0, 1, 0).astype(np.uint16)
    single = {2: (60, 70), 3: (349, 349), 7: (200, 51)}
    for part, (y, x) in single.items():
        parts[y, x] = part
    should = np.array([[5, 6]])
    sampler = SimpleNamespace(where_parts_should_be=lambda: should)
    truth = SimpleNamespace(seed=4, frame_index=9, row_poses=(1,) if rolling else ())
    asked = {tuple(p) for p in sample_pixels(truth, mask, {"parts": parts}, sampler).tolist()}
    assert len(asked) > 10
    found = {part for part, (y, x) in single.items() if (x, y) in asked}
    # of a rolling shutter no pixel's part is known by geometry alone
    assert found == (set() if rolling else set(single))
    assert ((5, 6) in asked) is not rolling
    assert sample_pixels(truth, 0 * mask, {}, sampler).shape == (0, 2)
