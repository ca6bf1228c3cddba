"""A body from a plug-in: orbit, image, shadow and light of Mars, and reproduction from its record."""

from dataclasses import replace
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import take_frame
from flyaround.simulator.imaging.exposure import ground_drawings, integrate
from flyaround.simulator.imaging.image_motion import image_motion_px, motion_bound_px
from flyaround.simulator.labels.truth import read_truth, truth_to_json
from flyaround.simulator.recipes.backgrounds import without_target
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.scene.environments import NOTHING
from flyaround.simulator.scene.illumination.atmosphere import body_atmosphere, rayleigh_phase
from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.world.constants import AU_M
from flyaround.simulator.world.ephemeris.body import body_named
from flyaround.simulator.world.frames.rotation import matrix_from_quat

MODULE = Path(__file__).parents[4] / "examples" / "plugin_package" / "flyaround_example" / "mars.py"
SCENARIO = """
schema = "flyaround.scenario"
version = 1
epoch_utc = "2026-06-01T00:00:00Z"
duration_s = 7200
target = "tango@low"
orbit = {{ kind = "elements", centre = "mars", altitude_km = 400.0, inclination_deg = 70.0 }}
chaser = {{ mode = "hold", position_lvlh_m = [{height_m}, 0.0, 0.0] }}
camera = "square-1024"
environment = {{ {environment} }}
"""
FLAT = """
from dataclasses import replace
from pathlib import Path
from mars import MARS
FLAT = replace(MARS, name="flat", flattening=0.2, albedo_map=str(Path(__file__).with_name("map.png")))
"""
RADIUS_M = 3_389_500.0
pytestmark = pytest.mark.gl


@pytest.fixture(scope="module", autouse=True)
def mars(tmp_path_factory):
    """The module as an installed package's, by its entry point."""
    folder = tmp_path_factory.mktemp("packages")
    info = folder / "mars_body-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mars-body\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[flyaround.bodies]\nmars = mars:MARS\nflat = flat:FLAT\nnumber = mars:AU_M\n"
    )
    (folder / "mars.py").write_text(MODULE.read_text())
    (folder / "flat.py").write_text(FLAT)
    # west of longitude 0 it is bright
    cv2.imwrite(str(folder / "map.png"), np.tile(np.repeat(np.uint8([204, 51]), 32), (32, 1)))
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        yield body_named("mars")
        body_named.cache_clear()


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    def planned(*, height_m=12.0, environment='preset = "full"', n=5):
        path = tmp_path_factory.mktemp("scenarios") / "mars.toml"
        path.write_text(SCENARIO.format(height_m=height_m, environment=environment))
        return plan_flight(load_scenario(path), n=n)

    return planned


def seen_from(scene, to_sun_camera, distance_m):
    """Without the craft, from a distance, the Sun in a direction of the camera's axes."""
    R_eci_from_camera = matrix_from_quat(scene.q_camera_from_eci_wxyz).T
    centre = np.array(scene.central.r_eci_m)
    ahead, to_sun = R_eci_from_camera[:, 2], R_eci_from_camera @ np.asarray(to_sun_camera)
    camera = vec3(centre - distance_m * ahead)
    scene = replace(scene, r_camera_eci_m=camera, r_sun_eci_m=vec3(centre + 1.5 * AU_M * to_sun))
    return without_target(scene)


def test_the_craft_circles_mars(plan, mars):
    flight = plan().flight
    a = RADIUS_M + 400e3
    period = 2 * np.pi * np.sqrt(a**3 / 4.2828375e13)
    start, end = flight.state(0.0), flight.state(period)
    r0, r1 = (np.subtract(s.r_target_eci_m, s.central.r_eci_m) for s in (start, end))
    assert start.central.body is mars
    assert start.altitude_m == pytest.approx(400e3, abs=1.0)
    # where Mars is on the day to half an arc minute is no matter; by how much it moves in two hours is
    assert np.linalg.norm(r1 - r0) < 10.0
    assert 0.5 * AU_M < np.linalg.norm(start.central.r_eci_m) < 2.7 * AU_M
    turned = start.central.R_fixed_from_eci @ end.central.R_fixed_from_eci.T
    assert np.arccos((np.trace(turned) - 1) / 2) == pytest.approx(7.088218e-5 * period, rel=1e-6)


def test_disc_and_light_are_those_of_a_lambert_sphere(renderer, plan):
    planned = plan(environment='preset = "airless", stars = false, planets = false')
    far = 10 * RADIUS_M
    scene = seen_from(planned.scene(0), (0.0, 0.0, -1.0), far)
    c, target = scene.camera, planned.target
    light = renderer.render(scene, target).radiance
    u, v = np.meshgrid(np.arange(c.width_px), np.arange(c.height_px))
    rays = c.rays(np.stack([u, v], axis=-1).reshape(-1, 2))
    along = far * rays[:, 2]
    inside = along**2 - far**2 + RADIUS_M**2
    ground = (along - np.sqrt(np.maximum(inside, 0)))[:, None] * rays - [0, 0, far]
    cosine = np.maximum(-ground[:, 2] / RADIUS_M, 0) * (inside > 0)
    lambert = (0.25 / np.pi * sun_irradiance_w_m2("mono", 1.5 * AU_M)[0] * cosine).reshape(light.shape)
    assert light.sum() == pytest.approx(lambert.sum(), rel=2e-3)
    assert np.abs(light - lambert)[lambert > 0.3 * lambert.max()].max() < 2e-3 * lambert.max()
    # the limb below a Sun at the side is bright: its place in the middle row, by the light of the pixel that it crosses
    half = renderer.render(seen_from(planned.scene(0), (1.0, 0.0, 0.0), far), target).radiance
    row = half[round(c.cy_px)]
    last = np.flatnonzero(row > 0.9 * row.max())[-1]
    limb = last + 0.5 + row[last + 1] / row[last]
    expected = c.cx_px + c.fx_px * np.tan(np.arcsin(RADIUS_M / far))
    assert limb == pytest.approx(expected, abs=0.05)
    # and its night is black
    assert not half[:, : round(c.cx_px) - 2].any()


def test_an_ellipsoid_and_its_map_are_where_rays_find_them(renderer, plan):
    planned = plan(environment='preset = "airless", stars = false, planets = false')
    scene = planned.scene(0)
    flat = replace(scene.central, name="flat", q_fixed_from_eci_wxyz=(0.6, 0.48, 0.64, 0.0))
    scene = replace(scene, central_body="flat", bodies=(*scene.bodies[:2], flat))
    scene = seen_from(scene, (0.6, 0.0, -0.8), 10 * RADIUS_M)
    light = renderer.render(scene, planned.target).radiance
    c = scene.camera
    u, v = np.meshgrid(np.arange(c.width_px), np.arange(c.height_px))
    R_fixed_from_camera = flat.R_fixed_from_eci @ matrix_from_quat(scene.q_camera_from_eci_wxyz).T
    rays = c.rays(np.stack([u, v], axis=-1).reshape(-1, 2)) @ R_fixed_from_camera.T
    camera = flat.R_fixed_from_eci @ np.subtract(scene.r_camera_eci_m, flat.r_eci_m) / RADIUS_M
    axes = np.array([1.0, 1.0, 0.8])
    d, o = rays / axes, camera / axes
    a, b = (d * d).sum(axis=1), d @ o
    inside = b**2 - a * (o @ o - 1)
    ground = camera + ((-b - np.sqrt(np.maximum(inside, 0))) / a)[:, None] * rays
    normal = ground / axes**2
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    longitude = np.arctan2(ground[:, 1], ground[:, 0])
    albedo = np.where(longitude < 0, 0.8, 0.2)
    cosine = np.maximum(normal @ R_fixed_from_camera @ [0.6, 0.0, -0.8], 0)
    lambert = albedo / np.pi * sun_irradiance_w_m2("mono", 1.5 * AU_M)[0] * cosine
    # away from limb, terminator and the map's edges
    kept = (
        (inside > 0.02) & (cosine > 0.05) & (np.abs(np.sin(longitude)) > 0.15) & (np.abs(normal[:, 2]) < 0.9)
    )
    assert kept.sum() > 2e4
    assert np.abs(light.ravel()[kept] / lambert[kept] - 1).max() < 0.01
    assert not light.ravel()[inside < -0.02].any()


@pytest.mark.parametrize("bands", ["mono", "rgb"])
def test_thin_air_adds_a_little_light(renderer, plan, mars, bands):
    light = {}
    for preset in ("full", "airless"):
        planned = plan(environment=f'preset = "{preset}", stars = false, planets = false')
        scene = replace(seen_from(planned.scene(0), (0.6, 0.0, -0.8), 10 * RADIUS_M), bands=bands)
        light[preset] = renderer.render(scene, planned.target).radiance
    assert light["full"].sum() == pytest.approx(light["airless"].sum(), rel=0.03)
    # beyond the limb there is nothing but air: at most what its slant optical depth sends from the whole of a pixel
    air = body_atmosphere(mars, bands)
    depth = air.rayleigh_m[-1] * np.sqrt(2 * np.pi * RADIUS_M * mars.air.rayleigh_height_m)
    most = sun_irradiance_w_m2(bands, 1.5 * AU_M)[-1] * depth * rayleigh_phase(np.float64(-0.8))
    beyond = light["full"][light["airless"] == 0].max()
    assert 0.1 * most < beyond < 1.1 * most


def test_an_exposure_smears_the_ground_by_the_orbits_motion(renderer, plan):
    planned = plan(environment='preset = "full", stars = false, planets = false')
    k = max(range(planned.n_frames), key=lambda k: -planned.scene(k).sun_direction_camera[2])
    scene, target = planned.scene(k), planned.target
    # the camera turns with the orbit; what is straight below goes by at the rate of the circle of Mars's radius
    rate = np.sqrt(4.2828375e13 / (RADIUS_M + 400e3) ** 3) * RADIUS_M / 400e3
    way = image_motion_px(scene, target, 0.05)
    assert way == pytest.approx(rate * 0.05 * scene.camera.fx_px, rel=0.1)
    assert way < motion_bound_px(scene, target, 0.05) < 2.5 * way
    assert ground_drawings(replace(scene, exposure_s=0.05)) > 0
    still, smeared = (
        integrate(renderer, replace(scene, exposure_s=s), target).radiance for s in (1e-4, 0.05)
    )
    assert smeared.mean() == pytest.approx(still.mean(), rel=0.01)


def test_mars_shades_and_lights_the_craft(renderer, plan):
    # from below, where at noon nothing but Mars lights what is seen
    planned = plan(height_m=-12.0, n=61)
    shares = [planned.scene(k).sun_visible_fraction for k in range(planned.n_frames)]
    noon = np.argmax([planned.scene(k).sun_direction_camera[2] for k in range(planned.n_frames)])
    dark, lit = shares.index(0.0), int(noon)
    bright = {}
    for k in (dark, lit):
        scene = planned.scene(k)
        for earthshine in (True, False):
            alone = msgspec.structs.replace(NOTHING, earthshine=earthshine)
            image = renderer.render(replace(scene, environment=alone), planned.target).radiance
            bright[k, earthshine] = float(image.sum())
    assert bright[dark, False] == 0.0
    assert bright[dark, True] < 0.01 * bright[lit, True]
    assert bright[lit, True] > 1.5 * bright[lit, False] > 0


def test_frame_is_reproduced_from_its_record(renderer, plan, tmp_path):
    planned = plan()
    k = next(k for k in range(planned.n_frames) if planned.scene(k).sun_visible_fraction == 1.0)
    frame = take_frame(renderer, planned.scene(k), planned.target)
    path = tmp_path / "mars.json"
    path.write_bytes(truth_to_json(frame.truth))
    record = read_truth(path)
    assert record.scene == frame.scene
    assert [b["name"] for b in msgspec.json.decode(path.read_bytes())["scene"]["bodies"]] == ["mars"]
    again = take_frame(renderer, record.scene, planned.target)
    assert np.array_equal(again.image, frame.image)
    assert again.image.any()
    path.write_bytes(path.read_bytes().replace(b'"mars"', b'"pluto"'))
    with pytest.raises(UserError, match="unknown body 'pluto'; choose from earth, moon, flat, mars, number"):
        read_truth(path)


def test_plugin_that_is_no_body_is_refused():
    with pytest.raises(UserError, match=r"body number of package mars-body 1\.0 is not a Body named number"):
        body_named("number")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("forces = { drag = true }\nschema", "has no model about Mars"),
        ("forces = { gravity_degree = 4 }\nschema", "allowed about Mars: 0"),
        (
            'attitude = { motion = "tumble", residual_dipole_a_m2 = [1.0, 0.0, 0.0] }\nschema',
            "this orbit is about Mars",
        ),
    ],
)
def test_what_has_no_model_about_mars_is_refused(tmp_path, change, said):
    path = tmp_path / "mars.toml"
    text = SCENARIO.format(height_m=12.0, environment="")
    path.write_text(text.replace("schema", change, 1))
    with pytest.raises(UserError, match=said):
        load_scenario(path)
    path.write_text(text.replace('"mars"', '"vulcan"'))
    with pytest.raises(UserError, match="unknown body 'vulcan'"):
        load_scenario(path)
