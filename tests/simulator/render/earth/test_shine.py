"""Earthshine on the target against the integral over the Earth drawn from the same position."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.render.earth import earth_view
from flyaround.simulator.render.earth.shine import ShineSampler
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.illumination.irradiance import basis
from flyaround.simulator.scene.state import TargetRef
from flyaround.simulator.scene.viewpoint import scene_above
from flyaround.simulator.world.frames.rotation import matrix_from_quat

pytestmark = pytest.mark.gl
FAR_KM = 10_000.0  # from here the Earth is within the view straight down
DAY, NIGHT = (
    Environment(stars=False, planets=False, sun=False, moon=moon, night_lights=False)
    for moon in (False, True)
)


@pytest.fixture(scope="module")
def speck(draw_kit):
    return draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])


def above(speck, epoch, place, world, bands, *, off_nadir_deg=0.0, azimuth_deg=0.0):
    size, half_deg = 320, 10.0 if place[2] > FAR_KM else 45.0
    focal, middle = size / 2 / np.tan(np.radians(half_deg)), (size - 1) / 2
    return scene_above(
        epoch,
        place,
        camera=Camera(width_px=size, height_px=size, fx_px=focal, fy_px=focal, cx_px=middle, cy_px=middle),
        target=TargetRef(name=speck.name, sha256=speck.sha256),
        environment=world,
        bands=bands,
        off_nadir_deg=off_nadir_deg,
        azimuth_deg=azimuth_deg,
    )


def irradiance(renderer, speck, normals, *where):
    """(P, n) of plates with normals (P, 3), GCRS: pictures of all directions that the Earth can be in, added up."""
    faces = (
        [(0.0, 0.0)]
        if where[1][2] > FAR_KM
        else [(0.0, 0.0), *((90.0, a) for a in (0.0, 90.0, 180.0, 270.0))]
    )
    total = 0.0
    for off_nadir_deg, azimuth_deg in faces:
        scene = above(speck, *where, off_nadir_deg=off_nadir_deg, azimuth_deg=azimuth_deg)
        light = renderer.render(scene, speck).radiance.astype(float)
        light = light.reshape(light.shape[0] * light.shape[1], -1)
        c = scene.camera
        v, u = np.mgrid[: c.height_px, : c.width_px]
        rays = np.stack([(u - c.cx_px) / c.fx_px, (v - c.cy_px) / c.fy_px, np.ones(u.shape)], -1).reshape(
            -1, 3
        )
        length = np.linalg.norm(rays, axis=1)
        directions = (rays / length[:, None]) @ matrix_from_quat(scene.q_camera_from_eci_wxyz)
        solid_angle = 1 / (length**3 * c.fx_px * c.fy_px)
        total = total + np.maximum(normals @ directions.T, 0) @ (light * solid_angle[:, None])
    return total


OCEAN, DESERT, CLOUD, FOREST = (0.0, -140.0), (23.0, 12.0), (-55.0, 100.0), (-6.0, -62.0)


@pytest.mark.parametrize(
    ("ground", "altitude_km", "sun_deg", "bands"),
    [
        (OCEAN, 400.0, 15.0, "rgb"),
        (OCEAN, 800.0, 60.0, "mono"),
        (DESERT, 400.0, 30.0, "mono"),
        (DESERT, 1500.0, 75.0, "rgb"),
        (CLOUD, 400.0, 60.0, "mono"),
        (CLOUD, 250.0, 83.0, "rgb"),
        (FOREST, 600.0, 0.0, "rgb"),
        (FOREST, 35_786.0, 40.0, "mono"),
        (OCEAN, 35_786.0, 80.0, "rgb"),
        (OCEAN, 420.0, None, "mono"),
        (FOREST, 700.0, None, "rgb"),
    ],
)
def test_plates_get_the_light_of_the_drawn_earth(
    renderer, speck, monkeypatch, ground, altitude_km, sun_deg, bands
):
    """In one or three bands; ``sun_deg`` of the zenith, None: at night under the full Moon."""
    night = sun_deg is None
    # local noon less or more hours that the Sun needs to go down by the angle, to some degrees
    hour = (12 - ground[1] / 15 + (12 if night else (sun_deg or 0.0) / 15)) % 24
    epoch = f"2026-{'01-03' if night else '03-20'}T{int(hour):02d}:{int(hour % 1 * 60):02d}:00Z"
    where = epoch, (*ground, altitude_km), NIGHT if night else DAY, bands
    fields = []
    field = ShineSampler.field

    def kept(self, *given):
        fields.append(field(self, *given))
        return fields[-1]

    monkeypatch.setattr(ShineSampler, "field", kept)
    monkeypatch.setattr(
        earth_view, "moon_on_plates", lambda _scene: np.zeros((96, 3 if bands == "rgb" else 1))
    )
    scene = replace(above(speck, *where), t_camera_from_target_m=(0.0, 0.0, 50.0))
    renderer.render(scene, speck)
    monkeypatch.undo()
    R = matrix_from_quat(scene.q_camera_from_eci_wxyz)
    down = np.array([0.0, 0.0, 1.0])
    around = np.radians(np.arange(0, 360, 45))
    level = np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
    normals = np.concatenate(
        [down[None], *(np.cos(t) * down + np.sin(t) * level for t in np.radians([40, 70, 90]))]
    )
    drawn = irradiance(renderer, speck, normals @ R, *where)
    given = basis(normals, fields[-1].axis) @ fields[-1].irradiance_w_m2
    brightest = drawn.max(axis=0)
    assert np.all(brightest > 0)
    # 3 to 5 % in most places. Patches of cloud lie between the rays, and their mean light hangs on a pixel's width, in
    # the pictures by up to 7 %. From far away the Earth is a small disc: ten numbers hold its light on plates to 4 %
    assert (np.abs(given - drawn) / brightest).max() < 0.08
