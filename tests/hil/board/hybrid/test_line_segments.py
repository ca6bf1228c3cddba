"""Segments of the line segment detectors: position in pixels from the centre of the first pixel."""

import numpy as np
import pytest

from flyaround.hil.board.hybrid.image.line_segments import lsd_stream
from flyaround.hil.board.svd.line_streams import lsd_lines


@pytest.mark.parametrize("detector", [lsd_stream, lsd_lines])
@pytest.mark.parametrize("axis", [0, 1])
def test_segments_of_a_step_edge_lie_between_the_centres_of_its_pixels(detector, axis) -> None:
    errors = []
    # reduced by 0.8, the edge lies alike among the pixels every five boundaries
    for boundary in range(98, 103):
        image = np.full((240, 240), 20.0, np.float32)
        image[:, boundary:] = 180.0
        segments = detector(image if axis == 0 else np.ascontiguousarray(image.T), 50.0)
        assert len(segments)
        errors.append((segments[:, [axis, axis + 2]] - (boundary - 0.5)).mean())
    assert abs(np.mean(errors)) < 0.02
    assert np.abs(errors).max() < 0.1
