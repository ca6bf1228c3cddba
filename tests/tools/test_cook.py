"""Maps that come from others of them: the shipped files are what the cook makes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from flyaround.simulator.celestial.earth_albedo import albedo_map
from flyaround.simulator.celestial.earth_maps import asset_bytes, decode_map, packed_maps
from flyaround.simulator.celestial.seasons import LAND
from tools.cook.__main__ import cooked
from tools.cook.reduced_maps import land_of_months, make_albedo


def test_reduced_maps_are_those_of_the_packed_maps():
    packed = packed_maps(1)[0]
    assert np.array_equal(land_of_months(packed) > 0, decode_map(LAND, cv2.IMREAD_GRAYSCALE, None) > 0)
    for clouds in (False, True):
        # sums in another order on another processor
        assert albedo_map(clouds=clouds) == pytest.approx(make_albedo(packed, clouds=clouds)[0], abs=1e-5)


@pytest.mark.slow
def test_every_cooked_map_is_the_shipped_one():
    for name, content in cooked():
        if name.endswith(".png"):
            shipped = cv2.imdecode(np.frombuffer(asset_bytes(name), np.uint8), cv2.IMREAD_UNCHANGED)
            # rounding of another processor's sums
            different = np.abs(shipped.astype(int) - content.astype(int)) > 1
            assert different.mean() < 1e-5, name
