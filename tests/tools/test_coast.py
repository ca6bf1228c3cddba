"""The map of coasts from shapefiles: where land begins, and which lakes are water."""

import struct

import numpy as np
import pytest

from tools.cook.coast import coast_map, is_dry, polygons

WIDTH, HEIGHT = 72, 36  # 5 degrees a pixel


def shapefile(*records, kind=5):
    """The bytes of a shapefile of polygons, each a list of rings."""
    data = bytes(100)
    for number, rings in enumerate(records, 1):
        first = np.cumsum([0, *map(len, rings)])
        body = struct.pack("<i32x2i", kind, len(rings), first[-1])
        body += np.array(first[:-1], "<i4").tobytes() + np.array(np.concatenate(rings), "<f8").tobytes()
        data += struct.pack(">2i", number, len(body) // 2) + body
    return data


def box(west, south, east, north, *, hole=False):
    corners = [(west, south), (west, north), (east, north), (east, south), (west, south)]
    return np.array(corners[::-1] if hole else corners, float)


GREEN = np.full((HEIGHT, WIDTH, 3), (20, 80, 30), np.uint8)


def pixel(image, longitude, latitude):
    return int(image[int((90 - latitude) / 5), int((longitude + 180) / 5)])


def test_distance_is_in_sixteenths_of_a_pixel_and_positive_on_land():
    image = coast_map(shapefile([box(0, -40, 80, 40)]), b"", GREEN, WIDTH, HEIGHT)
    # pixel centres lie half a pixel, one and a half and so on from the coast at 0 degrees
    row = [pixel(image, longitude, 1) for longitude in (-7.5, -2.5, 2.5, 7.5)]
    assert row == [128 - 24, 128 - 8, 128 + 8, 128 + 24]
    assert pixel(image, -150, 1) == 0


def test_holes_and_lakes_are_water_and_islands_in_lakes_are_land():
    land = shapefile([box(-90, -60, 90, 60), box(-80, -20, -40, 20, hole=True)])
    lakes = shapefile([box(0, -40, 80, 40), box(30, -10, 50, 10, hole=True)], [box(70, -40, 85, 40)])
    image = coast_map(land, lakes, GREEN, WIDTH, HEIGHT)
    expected = {-85: True, -60: False, -20: True, 15: False, 40: True, 75: False, 83: False, 88: True}
    assert {longitude: pixel(image, longitude, 0) > 128 for longitude in expected} == expected


def test_land_goes_on_across_the_date_line_and_over_the_pole():
    land = shapefile([box(170, -30, 180, 30)], [box(-180, -30, -170, 30)], [box(-180, -90, 180, -60)])
    image = coast_map(land, b"", GREEN, WIDTH, HEIGHT)
    # no coast at the date line: the nearest is two pixels away
    assert pixel(image, 179, 0) == pixel(image, -179, 0) == 128 + 24
    assert (image[-1] == 128 + 16 * 6 - 8).all()


@pytest.mark.parametrize(
    ("colour", "dry"), [((100, 130, 200), True), ((60, 110, 118), False), ((70, 5, 2), False)]
)
def test_a_lake_that_the_day_map_shows_as_a_salt_flat_is_dry(colour, dry):
    lake = box(0, -40, 80, 40)
    day = GREEN.copy()
    day[10:26, 36:52] = colour
    assert is_dry([lake], day) == dry
    image = coast_map(shapefile([box(-90, -60, 90, 60)]), shapefile([lake]), day, WIDTH, HEIGHT)
    assert (pixel(image, 40, 0) > 128) == dry


def test_a_lake_too_small_for_the_day_map_is_kept():
    assert not is_dry([box(0, 0, 9, 9)], np.full_like(GREEN, (100, 130, 200)))


def test_a_shapefile_of_something_else_is_refused():
    with pytest.raises(ValueError, match="shape type 3, not 5"):
        list(polygons(shapefile([box(0, 0, 1, 1)], kind=3)))
