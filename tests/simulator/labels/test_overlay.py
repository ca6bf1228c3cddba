"""Pictures under drawn labels: as bright in eight bits of any depth."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.labels.overlay import screen_rgb

IDEAL = sensor_preset("ideal")


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
def test_a_picture_of_any_depth_is_as_bright_in_eight_bits(bits):
    share = np.linspace(0, 1, 12)
    kind = np.uint8 if bits == 8 else np.uint16
    grey = np.rint(share * (2**bits - 1)).astype(kind).reshape(3, 4)
    drawn = screen_rgb(grey, replace(IDEAL, bits=bits), "linear")
    assert (drawn.dtype, drawn.shape) == (np.uint8, (3, 4, 3))
    wanted = screen_rgb(np.rint(share * 255).astype(np.uint8).reshape(3, 4), IDEAL, "linear")
    assert np.abs(drawn.astype(int) - wanted).max() <= 3
    # three equal bands are grey; red light alone is red
    colour = screen_rgb(np.dstack([grey] * 3), replace(IDEAL, bits=bits), "linear")
    assert np.abs(colour.astype(int) - drawn).max() <= 1
    red = screen_rgb(np.dstack([grey, 0 * grey, 0 * grey]), replace(IDEAL, bits=bits), "linear")
    assert (red[..., 0] >= red[..., 1:].max(axis=2)).all()
