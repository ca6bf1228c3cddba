"""Recipes: what is drawn is what the recipe says, and sample k depends on (recipe, seed, k) alone."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Distortion
from flyaround.simulator.errors import UserError
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.recipes.poses import draw_pose
from flyaround.simulator.scenario.load import list_recipes, load_recipe
from flyaround.simulator.scenario.recipe import UniformRange
from flyaround.simulator.targets.library import built_in_targets, load_target
from flyaround.simulator.world.constants import EARTH_RADIUS_M
from flyaround.simulator.world.frames.rotation import matrix_from_quat

N = 400


@pytest.fixture(scope="module", params=["eval-black", "eval-earth", "thesis"])
def plan(request):
    return plan_recipe(request.param, N, seed=11)


@pytest.fixture(scope="module")
def scenes(plan):
    return [plan.scene(k) for k in range(N)]


def test_range_is_uniform_from_3_to_18_m(scenes):
    z = np.sort([s.t_camera_from_target_m[2] for s in scenes])
    assert z[0] >= 3
    assert z[-1] <= 18
    # Kolmogorov-Smirnov at 0.1 %: 1.95 / sqrt(n)
    assert np.abs((z - 3) / 15 - (np.arange(N) + 0.5) / N).max() < 1.95 / np.sqrt(N)


def test_attitude_is_uniform_on_so3(scenes):
    q = np.array([s.q_camera_from_target_wxyz for s in scenes])
    # for Haar measure every component squared has mean 1/4 and variance 1/24... (w >= 0 changes neither)
    assert np.allclose((q**2).mean(axis=0), 0.25, atol=4 * np.sqrt(1 / 16 / N))
    assert q[:, 0].min() >= 0


def test_sunlit_and_phase_below_120_degrees(scenes):
    assert all(s.sun_visible_fraction > 0.99 for s in scenes)
    phase = [np.degrees(np.arccos(-s.sun_direction_camera[2])) for s in scenes]
    assert max(phase) <= 120.1
    assert max(phase) > 100


def test_the_earth_is_where_the_recipe_wants_it(plan, scenes):
    (sky,) = plan.recipe.sky
    low, high = sky.nadir_off_boresight_deg
    for s in scenes:
        r = np.array(s.r_camera_eci_m)
        nadir = matrix_from_quat(s.q_camera_from_eci_wxyz) @ (-r / np.linalg.norm(r))
        assert low - 0.1 <= np.degrees(np.arccos(nadir[2])) <= high + 0.1
        assert np.linalg.norm(r) == pytest.approx(EARTH_RADIUS_M + 1e3 * sky.altitude_km, abs=30)


def test_camera_and_target_positions_agree_with_the_pose(plan, scenes):
    com = np.array(plan.target.mass.com_m)
    for s in scenes[:50]:
        R = matrix_from_quat(s.q_camera_from_eci_wxyz)
        seen = R @ (np.array(s.r_target_eci_m) - np.array(s.r_camera_eci_m))
        expected = matrix_from_quat(s.q_camera_from_target_wxyz) @ com + np.array(s.t_camera_from_target_m)
        # positions are 7e6 m in float64: 1e-9 m rounding each
        assert np.allclose(seen, expected, atol=1e-7)


def test_the_bounding_sphere_stays_in_view_where_it_fits(plan, scenes):
    radius = max(np.linalg.norm(p.positions_m, axis=1).max() for p in plan.target.parts)
    for s in scenes:
        x, y, z = s.t_camera_from_target_m
        pixel = s.camera.project(np.array([x, y, z]))
        for p, size, f in zip(
            pixel,
            (s.camera.width_px, s.camera.height_px),
            (s.camera.fx_px, s.camera.fy_px),
            strict=True,
        ):
            r = f * radius / z
            if r < size / 2:
                assert r - 1 <= p <= size - r


def test_sample_depends_on_seed_and_number_alone():
    a, b = plan_recipe("eval-earth", 10, seed=3), plan_recipe("eval-earth", 500, seed=3)
    assert a.scene(7) == b.scene(7)
    assert a.scene(7) != plan_recipe("eval-earth", 10, seed=4).scene(7)
    assert a.scene(7) != a.scene(8)


def test_unknown_recipe():
    with pytest.raises(UserError, match=r"eval-earth.*eval-black-NAME"):
        plan_recipe("eval-red", 1)


def test_thesis_recipe_flies_the_thesis_geometry_with_its_noise():
    plan = plan_recipe("thesis", 1)
    assert plan.target.name == "tango-thesis"
    assert plan.scene(0).target.name == "tango-thesis"
    assert (plan.recipe.sensor.preset, plan.recipe.range.near_m, plan.recipe.range.far_m) == (
        "thesis",
        3.0,
        18.0,
    )


def test_every_target_has_its_recipe_by_name_and_by_option():
    for name in built_in_targets():
        by_name = plan_recipe(f"eval-black-{name}", 3, seed=4)
        by_option = plan_recipe("eval-black", 3, seed=4, target=name)
        assert by_name.scene(2) == by_option.scene(2)
        assert f"eval-black-{name}" not in list_recipes()


@pytest.mark.parametrize("name", list_recipes())
def test_every_recipe_is_read_and_has_what_a_list_shows(name):
    recipe = load_recipe(name)
    assert recipe.name == name
    assert recipe.title
    assert all(load_recipe(member).members == [] for member in recipe.members)


def half_diagonal_m(target):
    points = np.concatenate([p.positions_m for p in target.parts]).astype(float)
    return np.linalg.norm(np.ptp(points, axis=0)) / 2


@pytest.mark.parametrize("name", built_in_targets())
def test_every_target_is_as_large_in_the_image_as_tango(name):
    plan = plan_recipe(f"eval-black-{name}", 60, seed=2)
    tango = half_diagonal_m(load_target("tango"))
    size = half_diagonal_m(plan.target)
    low, high = plan.recipe.range.near_m, plan.recipe.range.far_m
    # ranges are rounded to a millimetre
    assert size / low == pytest.approx(tango / 3, rel=1e-3)
    assert size / high == pytest.approx(tango / 18, rel=1e-3)
    assert plan.scenario_document["range"] == {"kind": "uniform", "near_m": low, "far_m": high}
    z = [plan.scene(k).t_camera_from_target_m[2] for k in range(60)]
    assert low <= min(z) < low + 0.2 * (high - low)
    assert high - 0.2 * (high - low) < max(z) <= high
    # the camera never comes inside the craft
    assert low > 1.5 * max(np.linalg.norm(p.positions_m, axis=1).max() for p in plan.target.parts)


def test_the_range_of_a_recipe_is_the_origins_depth_and_that_of_a_flight_the_centre_of_mass():
    """As docs/conventions.md has it: a recipe's range is z of the pose label."""
    plan = plan_recipe("eval-black", 40)
    depths = [plan.scene(k).t_camera_from_target_m[2] for k in range(40)]
    low, high = plan.recipe.range.near_m, plan.recipe.range.far_m
    assert low <= min(depths) < low + 3
    assert high - 3 < max(depths) <= high
    scene, com = plan.scene(0), np.array(plan.target.mass.com_m)
    apart = np.linalg.norm(np.subtract(scene.r_target_eci_m, scene.r_camera_eci_m))
    # positions in orbit are kept to a nanometre or so
    assert apart == pytest.approx(np.linalg.norm(scene.camera_from_target.apply(com)), abs=1e-6)


def test_random_places_fill_the_room_up_to_the_frames_edge(draw_kit):
    """The sphere is drawn evenly over all of the room that it has, across and down, and never leaves the frame."""
    target, camera, rng = load_target("tango@low"), draw_kit.lens_camera, np.random.default_rng(8)
    radius = max(np.linalg.norm(p.positions_m, axis=1).max() for p in target.parts)
    recipe = msgspec.structs.replace(load_recipe("eval-black"), range=UniformRange(near_m=5.0, far_m=15.0))
    straight = replace(camera, distortion=Distortion())
    places = []
    for k in range(N):
        t = draw_pose(rng, recipe, camera, target, k).t_camera_from_target_m
        half = np.array([camera.fx_px, camera.fy_px]) * radius / t[2]
        size = np.array([camera.width_px, camera.height_px])
        room = size / 2 - half
        assert np.all(room > 0)
        off = straight.project(t) - (size - 1) / 2
        places.append(off / room)
    for u in np.sort(places, axis=0).T:
        # it comes within a fiftieth of its room to each edge, and no nearer than the edge
        assert -1 - 1e-9 <= u[0] < -0.98
        assert 0.98 < u[-1] <= 1 + 1e-9
        # Kolmogorov-Smirnov at 0.1 %
        assert np.abs((u + 1) / 2 - (np.arange(N) + 0.5) / N).max() < 1.95 / np.sqrt(N)
