"""The map of coasts from shapefiles: where land begins, and which lakes are water."""

import struct

import numpy as np

from tools.cook.coast import coast_map

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


def test_holes_and_lakes_are_water_and_islands_in_lakes_are_land():
    land = shapefile([box(-90, -60, 90, 60), box(-80, -20, -40, 20, hole=True)])
    lakes = shapefile([box(0, -40, 80, 40), box(30, -10, 50, 10, hole=True)], [box(70, -40, 85, 40)])
    image = coast_map(land, lakes, GREEN, WIDTH, HEIGHT)
    expected = {-85: True, -60: False, -20: True, 15: False, 40: True, 75: False, 83: False, 88: True}
    assert {longitude: pixel(image, longitude, 0) > 128 for longitude in expected} == expected
