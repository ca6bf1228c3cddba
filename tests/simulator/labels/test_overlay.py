"""Pictures under drawn labels: as bright in 8 bits as in their own."""

import numpy as np
import pytest

from flyaround.simulator.labels.overlay import rgb_8bit


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
def test_a_picture_of_any_depth_is_as_bright_in_eight_bits(bits: int) -> None:
    share = np.linspace(0, 1, 12)
    kind = np.uint8 if bits == 8 else np.uint16
    grey = np.rint(share * (2**bits - 1)).astype(kind).reshape(3, 4)
    drawn = rgb_8bit(grey, bits)
    assert drawn.dtype == np.uint8
    assert drawn.shape == (3, 4, 3)
    assert np.abs(drawn.reshape(-1, 3) - 255 * share[:, None]).max() <= 1
    colour = np.dstack([grey, grey // 2, grey // 4])
    assert np.array_equal(rgb_8bit(colour, bits)[..., 1], rgb_8bit(grey // 2, bits)[..., 0])
