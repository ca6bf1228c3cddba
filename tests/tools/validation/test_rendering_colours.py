"""The rows of the rendering page about colour."""

import numpy as np
import pytest

from flyaround.simulator.camera.detector.response import SRGB_FROM_BANDS
from tools.validation.rendering import colours as rendering_colours


def test_three_bands_have_the_colours_of_whole_spectra():
    for row in rendering_colours.rows():
        assert row.met, row


def test_the_matrix_to_the_screen_is_the_fitted_one_and_keeps_white():
    fitted = rendering_colours.fitted(rendering_colours.colours())
    assert fitted == pytest.approx(np.array(SRGB_FROM_BANDS), abs=0.01)
    assert [sum(row) for row in SRGB_FROM_BANDS] == pytest.approx([1.0, 1.0, 1.0], abs=1e-9)
