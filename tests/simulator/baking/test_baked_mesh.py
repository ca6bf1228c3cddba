"""What is worked out of a mesh before it is uploaded: kept in the cache, and the same from there."""

import json

import numpy as np
import pytest

from flyaround.simulator.geometry.convex_shells import Boxes
from flyaround.simulator.runtime.serialisation import pack, unpack


def test_what_is_packed_comes_back_and_nothing_but_data_is_packed():
    boxes = Boxes(np.arange(6, dtype=np.float32).reshape(6, 1), np.zeros(0, int))
    again = unpack(pack((boxes, None, True, 0.1, float("inf"), "a"), tuple, Boxes), tuple, Boxes)
    assert again[1:] == (None, True, 0.1, float("inf"), "a")
    np.testing.assert_array_equal(again[0].extents_m, boxes.extents_m)
    assert again[0].of.shape == (0,)
    assert again[0].of.dtype == boxes.of.dtype
    with pytest.raises(TypeError, match="not among the requested kinds"):
        unpack(pack(boxes, Boxes), tuple)
    for unfit in (json, np.array([json], object), {"a": 1}):
        with pytest.raises(TypeError, match="cannot be stored"):
            pack(unfit)
