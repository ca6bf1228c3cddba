"""Robust weights against the costs of the books that they come from."""

from __future__ import annotations

import numpy as np
import pytest

from flyaround.hil.board.hybrid.refine.robust import geman_mcclure, tukey

RESIDUALS = np.linspace(-7.0, 7.0, 57)
STEP = 1e-4


@pytest.mark.parametrize("scale", [0.4, 1.7, 6.0])
def test_geman_mcclure_is_the_slope_of_its_cost(scale: float) -> None:
    """Central differences of a smooth cost: 1e-6."""

    def cost(r: np.ndarray) -> np.ndarray:
        return r**2 / 2 / (1 + r**2 / scale**2)

    slope = (cost(RESIDUALS + STEP) - cost(RESIDUALS - STEP)) / (2 * STEP)
    weight = geman_mcclure(np.ones_like(RESIDUALS), RESIDUALS, scale)
    np.testing.assert_allclose(weight * RESIDUALS, slope, atol=1e-6)
    np.testing.assert_allclose(geman_mcclure(np.full_like(RESIDUALS, 3.0), RESIDUALS, scale), 3 * weight)
    # a wrong edge far off pulls less than a right one near: not so with weights that fall as 1 / r^2 or slower
    pull = np.abs(weight * RESIDUALS)
    assert pull[0] < 0.2 * pull.max() or scale > 2


@pytest.mark.parametrize("limit", [0.5, 2.0, 6.0])
def test_tukey_is_the_slope_of_its_cost_and_ends(limit: float) -> None:
    def cost(r: np.ndarray) -> np.ndarray:
        return limit**2 / 6 * (1 - np.clip(1 - (r / limit) ** 2, 0, None) ** 3)

    slope = (cost(RESIDUALS + STEP) - cost(RESIDUALS - STEP)) / (2 * STEP)
    np.testing.assert_allclose(tukey(RESIDUALS, limit) * RESIDUALS, slope, atol=1e-6)
    assert not tukey(RESIDUALS, limit)[np.abs(RESIDUALS) >= limit].any()
