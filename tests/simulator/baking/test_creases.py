"""Creased foil: slopes and what a texel hides of them."""

import numpy as np

from flyaround.simulator.baking.creases import (
    DEVIATION_MAX,
    SIZE,
    SLOPE_MAX,
    VARIANCE,
    crease_levels,
    make_creases,
)


def test_each_level_keeps_the_variance_of_the_slopes():
    levels = crease_levels()
    assert [len(level) for level in levels] == [SIZE >> k for k in range(10)]
    for level in levels:
        slopes = (level[..., :2] / 255 - 0.5) * 2 * SLOPE_MAX
        hidden = level[..., 2] / 255 * DEVIATION_MAX
        total = (slopes**2).sum(axis=2).mean() + (hidden**2).mean()
        assert np.isclose(total, VARIANCE, rtol=0.25)


def test_facets_are_curved_gently_and_creases_between_them_are_sharp():
    slopes = make_creases()[..., :2].astype(float)
    bend = np.hypot(*np.moveaxis(np.diff(slopes, axis=1), 2, 0)).ravel()
    # a tenth of the places have most of the bending; the rest is film that mirrors
    creases = np.sort(bend)[-len(bend) // 10 :]
    assert (creases**2).sum() > 0.6 * (bend**2).sum()
    assert np.median(bend) < 0.2 * np.mean(creases)
    # the tile repeats without a seam
    seam = np.hypot(*np.moveaxis(slopes[:, 0] - slopes[:, -1], 1, 0))
    assert np.median(seam) < 3 * np.median(bend)
