"""Lattices that supersample the craft."""

from __future__ import annotations

import numpy as np
import pytest

from flyaround.simulator.render.craft.sample_pattern import SEVEN, SamplePattern, rotated


@pytest.mark.parametrize("pattern", [SEVEN, rotated(2), rotated(3, 2), rotated(1)])
def test_no_two_samples_of_a_pixel_share_a_row_or_column(pattern: SamplePattern) -> None:
    n = pattern.samples
    offsets = np.array([offset[2:] for offset in pattern.offsets()])
    for axis in range(2):
        cells = np.floor((offsets[:, axis] + 0.5) * n).astype(int)
        assert len(set(cells.tolist())) == n


def test_a_lattice_that_would_share_columns_is_refused() -> None:
    with pytest.raises(ValueError, match="coprime"):
        rotated(2, 2)
