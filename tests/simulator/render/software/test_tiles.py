"""Tiles of the screen: what a kind of tile promises holds at every pixel of it."""

import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.render.globe.globe_view import globe_view
from flyaround.simulator.render.projection import directions
from flyaround.simulator.render.software.tiles import earth_tiles
from flyaround.simulator.render.view import build_view
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.illumination.atmosphere import earth_atmosphere
from flyaround.simulator.scene.state import TargetRef
from flyaround.simulator.scene.viewpoint import scene_above

CAMERA = Camera(width_px=480, height_px=320, fx_px=3000.0, fy_px=3000.0, cx_px=239.5, cy_px=159.5)


@pytest.fixture
def limb_scene():
    def scene(off_nadir_deg):
        return scene_above(
            "2026-03-20T10:00:00Z",
            (20.0, 5.0, 700.0),
            off_nadir_deg=off_nadir_deg,
            target=TargetRef(name="none", sha256="0" * 64),
            environment=Environment(moon=False),
            bands="mono",
            camera=CAMERA,
        )

    return scene


@pytest.mark.parametrize("off_nadir_deg", [63.0, 64.5, 66.0])
def test_no_pixel_of_a_tile_of_air_meets_the_ground(limb_scene, off_nadir_deg):
    scene = limb_scene(off_nadir_deg)
    earth = globe_view(build_view(scene), CAMERA, earth_atmosphere("mono"))
    tiles = earth_tiles(earth, CAMERA, None, scene.epoch_utc)
    d = directions(CAMERA, np.arange(480.0), np.arange(320.0), earth.earth_from_camera)
    ground = earth.camera @ earth.camera - (d @ earth.camera) ** 2 < 1
    of_air = np.zeros_like(ground)
    for kind, centers in tiles.centers_px.items():
        for x, y in centers + 0.5 - tiles.size_px / 2 if kind.air else ():
            of_air[round(y) : round(y) + tiles.size_px, round(x) : round(x) + tiles.size_px] = True
    assert of_air.any()
    assert ground.any()
    assert not np.any(of_air & ground)


def test_fine_tiles_bend_no_more_than_whole_ones(limb_scene):
    scene = limb_scene(60.0)
    earth = globe_view(build_view(scene), CAMERA, earth_atmosphere("mono"))
    tiles = earth_tiles(earth, CAMERA, None, scene.epoch_utc)

    def on_ground(x, y):
        d = directions(CAMERA, x, y, earth.earth_from_camera)
        along = d @ earth.camera
        depth = np.sqrt(1 - (earth.camera @ earth.camera - along**2))
        return earth.camera - (along + depth)[..., None] * d

    bend = {False: 0.0, True: 0.0}  # [px]
    for kind, centers in tiles.centers_px.items():
        half = tiles.size_of(kind) / 2
        for x, y in centers.astype(float) if kind.smooth else ():
            plane = on_ground(x + half * np.array([-1.0, 1.0]), y + half * np.array([-1.0, 1.0])).mean(
                axis=(0, 1)
            )
            seen = np.linalg.solve(earth.earth_from_camera, plane / np.linalg.norm(plane) - earth.camera)
            off = CAMERA.project(seen) - (x, y)
            bend[kind.fine] = max(bend[kind.fine], float(np.linalg.norm(off)))
    assert len(tiles.halved[0]) > 10
    assert 0 < bend[True] < 1.1 * bend[False] < 0.45

    # quarters, and nothing twice: each halved tile is four, and no whole one
    fine = np.concatenate([c for k, c in tiles.centers_px.items() if k.fine])
    which, row, column = tiles.fine_place(fine)
    assert np.array_equal(np.sort(which * 4 + row * 2 + column), np.arange(4 * len(tiles.halved[0])))
    whole = np.concatenate([c for k, c in tiles.centers_px.items() if not k.fine])
    assert not set(zip(*tiles.place(whole), strict=True)) & set(zip(*tiles.halved, strict=True))
    corner = tiles.fine_corners_px[which, row, column]
    assert np.array_equal(corner + np.float32(tiles.size_px / 4), fine)
