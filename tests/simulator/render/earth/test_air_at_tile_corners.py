"""Ground irradiance at the corners of smooth tiles against the table that it is read from."""

import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.celestial.air_tables import GROUND_MU_MIN, GROUND_SAMPLES, air_tables
from flyaround.simulator.render.earth import earth_view
from flyaround.simulator.render.globe.frame_air import FrameAir
from flyaround.simulator.render.projection import directions
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.state import TargetRef
from flyaround.simulator.scene.viewpoint import scene_above

pytestmark = pytest.mark.gl
SOFTWARE_PATH = True
CAMERA = Camera(width_px=64, height_px=64, fx_px=180.0, fy_px=180.0, cx_px=31.5, cy_px=31.5)


def _ground(earth, columns_px, rows_px, thickness_km):
    """Cosine of the Sun's zenith angle where the rays through a grid meet the ground, and the table of its light."""
    d = directions(CAMERA, columns_px, rows_px, earth.earth_from_camera)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    along = d @ earth.camera
    disc = 1 - (earth.camera @ earth.camera - along**2)
    foot = earth.camera - (along + np.sqrt(disc))[..., None] * d
    return foot @ earth.sun, air_tables("mono", thickness_km * 1e3).ground[:, 0]


def test_light_straight_below_at_the_terminator_is_the_ground_s_own(renderer, draw_kit, monkeypatch):
    seen = {}
    corners, view = FrameAir.corners, earth_view.globe_view

    def kept_corners(self, columns_px, rows_px, *, all_ground):
        seen.update(air=corners(self, columns_px, rows_px, all_ground=all_ground), grid=(columns_px, rows_px))
        return seen["air"]

    def kept_view(*given):
        seen["earth"] = view(*given)
        return seen["earth"]

    monkeypatch.setattr(FrameAir, "corners", kept_corners)
    monkeypatch.setattr(earth_view, "globe_view", kept_view)
    speck = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])
    world = Environment(stars=False, moon=False)
    ref = TargetRef(name=speck.name, sha256=speck.sha256)
    scene = scene_above(
        "2026-03-20T05:55:00Z", (20.0, 5.0, 700.0), target=ref, environment=world, bands="mono", camera=CAMERA
    )
    renderer.render(scene, speck)

    mu, table = _ground(seen["earth"], *seen["grid"], world.atmosphere_thickness_km)
    assert (
        0 < mu.min() < 0.5 * mu.max() < 0.1
    )  # the light changes much, and nowhere as the angle from the nadir does
    exact = np.interp(mu, np.linspace(GROUND_MU_MIN, 1, GROUND_SAMPLES), table)
    # the frame's table, even steps of the perigee's depth, was off by up to 8 % here
    assert np.allclose(seen["air"][..., 2], exact, rtol=2e-3)


def test_cubics_between_every_other_corner_are_nearer_than_a_tile_s_plane(renderer, draw_kit, monkeypatch):
    seen = {}
    corners, view = FrameAir.corners, earth_view.globe_view

    def both(self, columns_px, rows_px, *, all_ground):
        coarse = corners(self, columns_px, rows_px, all_ground=all_ground)
        seen.update(all_ground=all_ground, coarse=coarse, exact=corners(self, columns_px, rows_px))
        seen["grid"] = columns_px, rows_px
        return coarse

    def kept_view(*given):
        seen["earth"] = view(*given)
        return seen["earth"]

    monkeypatch.setattr(FrameAir, "corners", both)
    monkeypatch.setattr(earth_view, "globe_view", kept_view)
    speck = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])
    ref = TargetRef(name=speck.name, sha256=speck.sha256)
    world = Environment(stars=False, moon=False)
    # low over the ground at dusk, where light and haze bend most
    scene = scene_above(
        "2026-03-20T05:55:00Z", (20.0, 5.0, 300.0), target=ref, environment=world, bands="mono", camera=CAMERA
    )
    renderer.render(scene, speck)
    assert seen["all_ground"]
    exact, coarse = seen["exact"], seen["coarse"]
    assert np.abs(coarse - exact).max() > 0  # every other one was left out
    # planes through every other corner miss the one in between by this much, tiles' own by a quarter of it
    plane = np.abs(0.5 * (exact[:, :-2] + exact[:, 2:]) - exact[:, 1:-1]).max(axis=(0, 1))
    limit = 0.25 * plane
    if not renderer.info.is_software:
        # GPUs filter textures by weights of eight bits: the light on the ground, from a table, is off by half of 1/256
        # of the table's steps at most (1.2e-4 of itself, seen by nobody); cubics both ways add up 1.6 times as much
        mu, table = _ground(seen["earth"], *seen["grid"], world.atmosphere_thickness_km)
        at = (np.array([mu.min(), mu.max()]) - GROUND_MU_MIN) / (1 - GROUND_MU_MIN) * (GROUND_SAMPLES - 1)
        steps = np.abs(np.diff(table[int(at[0]) : int(at[1]) + 2]))
        limit[2] += 2.6 * steps.max() / 512
    assert np.all(np.abs(coarse - exact).max(axis=(0, 1)) < limit)
