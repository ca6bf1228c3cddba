"""Values and functions of the API refuse numbers that mean nothing, in one sentence, before anything is computed."""

import math
from dataclasses import replace

import numpy as np
import pytest

import flyaround as fa
from flyaround.plugins import BodyAir, Instant, q_fixed_from_pole
from flyaround.simulator.world.attitude.rigid_body import propagate_attitude
from flyaround.simulator.world.attitude.torques import gravity_gradient_torque
from flyaround.simulator.world.frames.lvlh import lvlh_frame
from flyaround.simulator.world.frames.pose import Pose
from flyaround.simulator.world.frames.rotation import quat_from_matrix, quat_from_rotvec, quat_normalize
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import (
    Elements,
    elements_from_state,
    propagate,
    state_from_elements,
)

NAN, INF = math.nan, math.inf
UNIT, AHEAD = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 5.0)
R, V = np.array([7e6, 0.0, 0.0]), np.array([0.0, 7.5e3, 0.0])
J = np.diag([2.0, 2.0, 3.0])


def camera(**changes):
    numbers = {
        "width_px": 640,
        "height_px": 480,
        "fx_px": 500.0,
        "fy_px": 500.0,
        "cx_px": 319.5,
        "cy_px": 239.5,
    }
    return fa.Camera(**(numbers | changes))


def air(**changes):
    return BodyAir(**({"rayleigh_m_um4": 1e-6, "rayleigh_height_m": 8e3} | changes))


def instant(text="2026-03-20T12:00:00Z"):
    return Instant.from_utc(text)


VALUES = {
    "pose: zero quaternion": (lambda: Pose.from_arrays("a", "b", (0, 0, 0, 0), AHEAD), "not zero"),
    "pose: three numbers": (lambda: Pose.from_arrays("a", "b", (1, 0, 0), AHEAD), "four numbers"),
    "pose: two coordinates": (lambda: Pose.from_arrays("a", "b", UNIT, (0, 0)), "position of three"),
    "pose: rows": (lambda: Pose.from_arrays("a", "b", np.ones((2, 4)), AHEAD), "four numbers"),
    "pose: not finite": (lambda: Pose("a", "b", UNIT, (0.0, INF, 0.0)), "not a position"),
    "pose: not a number": (lambda: Pose("a", "b", (NAN, 0.0, 0.0, 0.0), AHEAD), "not a unit quaternion"),
    "pose: not of unit length": (
        lambda: Pose("a", "b", (2.0, 0.0, 0.0, 0.0), AHEAD),
        "not a unit quaternion",
    ),
    "quaternion: rows of three": (lambda: quat_normalize(np.ones((2, 3))), "four numbers"),
    "matrix: mirror": (lambda: quat_from_matrix(np.diag([1.0, 1.0, -1.0])), "rotation matrix"),
    "matrix: scaled": (lambda: quat_from_matrix(2 * np.eye(3)), "rotation matrix"),
    "matrix: not a number": (lambda: quat_from_matrix(np.full((3, 3), NAN)), "rotation matrix"),
    "matrix: shape": (lambda: quat_from_matrix(np.eye(2)), "rotation matrix"),
    "rotation vector: shape": (lambda: quat_from_rotvec((1.0, 0.0)), "three numbers"),
    "camera: no width": (lambda: camera(width_px=0), "whole numbers above 0"),
    "camera: half a pixel": (lambda: camera(height_px=480.5), "whole numbers above 0"),
    "camera: text": (lambda: camera(width_px="640"), "whole numbers above 0"),
    "camera: negative focal length": (lambda: camera(fx_px=-1.0), "focal lengths above 0"),
    "camera: focal length": (lambda: camera(fy_px=NAN), "finite numbers"),
    "camera: principal point": (lambda: camera(cx_px=INF), "finite numbers"),
    "camera: encoding": (lambda: camera(encoding="film"), "linear, srgb, gamma"),
    "camera: a point of two": (lambda: camera().project((1.0, 2.0)), "three coordinates"),
    "camera: a pixel of three": (lambda: camera().unproject((1.0, 2.0, 3.0)), "two coordinates"),
    "elements: no gravity": (
        lambda: state_from_elements(Elements(semi_major_axis_m=7e6), 0.0),
        "more than 0",
    ),
    "camera: resized to nothing": (lambda: camera().resized(0), "whole numbers above 0"),
    "instant: later by NaN": (lambda: instant().plus(NAN), "not finite"),
    "instant: later for ever": (lambda: instant().plus(INF), "not finite"),
    "instant: second 60 in the middle of a day": (lambda: instant("2026-01-01T00:00:60Z"), "does not exist"),
    "elements: negative axis": (lambda: Elements(semi_major_axis_m=-7e6), "bound orbit"),
    "elements: hyperbola": (lambda: Elements(semi_major_axis_m=7e6, eccentricity=1.5), "bound orbit"),
    "elements: angle": (lambda: Elements(semi_major_axis_m=7e6, raan_rad=INF), "not finite"),
    "state: too fast": (lambda: elements_from_state(R, 3 * V), "bound orbit"),
    "state: at rest": (lambda: elements_from_state(R, 0 * V), "no orbit plane"),
    "state: at the centre": (lambda: elements_from_state(0 * R, V), "no orbit plane"),
    "lvlh: a fall": (lambda: lvlh_frame(R, 1e-3 * R, 0 * R), "no orbit plane"),
    "lvlh: not a number": (lambda: lvlh_frame(R * NAN, V, 0 * R), "no orbit plane"),
    "torque at the centre": (lambda: gravity_gradient_torque(0 * R, np.eye(3), J), "not zero"),
    "torque at NaN": (lambda: gravity_gradient_torque(R * NAN, np.eye(3), J), "finite"),
    "attitude for NaN seconds": (lambda: propagate_attitude(UNIT, (0, 0, 0.1), J, NAN), "the span is nan"),
    "attitude backwards": (lambda: propagate_attitude(UNIT, (0, 0, 0.1), J, -1.0), "the span is -1"),
    "attitude at a rate of NaN": (lambda: propagate_attitude(UNIT, (0, 0, NAN), J, 1.0), "must be finite"),
    "attitude with an inertia of NaN": (
        lambda: propagate_attitude(UNIT, (0, 0, 0), J * NAN, 1.0),
        "the inertia is not finite",
    ),
    "orbit for NaN seconds": (lambda: propagate(R, V, NAN, Gravity()), "the span is nan"),
    "orbit from NaN": (lambda: propagate(R * NAN, V, 1.0, Gravity()), "must be finite"),
    "pole: not a number": (lambda: q_fixed_from_pole(NAN, 0.0, 0.0), "finite angles"),
    "pole: declination": (lambda: q_fixed_from_pole(0.0, 200.0, 0.0), "declination"),
    "air: no height": (lambda: air(rayleigh_height_m=0.0), "more than 0"),
    "air: negative": (lambda: air(rayleigh_m_um4=-1.0), "0 or more"),
    "air: asymmetry": (lambda: air(aerosol_g=2.0), "between -1 and 1"),
    "air: heights out of order": (lambda: air(density=((0.0, 1.0), (5.0, 0.5), (3.0, 0.1))), "increasing"),
    "air: no density": (lambda: air(density=((0.0, 1.0), (5.0, 0.0))), "above 0"),
}


@pytest.mark.parametrize("name", VALUES)
def test_a_value_that_means_nothing_is_refused(name):
    make, says = VALUES[name]
    with pytest.raises(ValueError, match=says):
        make()


@pytest.fixture(scope="module")
def scenario():
    return fa.load_scenario("tango-flyaround")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"n": 0}, "at least 1"),
        ({"n": 1.5}, "at least 1"),
        ({"times": ()}, "one time or more"),
        ({"times": (NAN,)}, "outside scenario"),
        ({"n": 1, "seed": 1.5}, "the seed is 1.5"),
        ({"n": 1, "seed": 2**63}, "below 2\\^63"),
        ({"n": 1, "bands": "grey"}, "mono, rgb"),
        ({"n": 1, "quality": "best"}, "draft, default, high"),
    ],
)
def test_a_flights_plan_refuses_options(scenario, options, says):
    with pytest.raises(fa.UserError, match=says):
        fa.plan_flight(scenario, **options)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"n": 0}, "at least 1"),
        ({"n": -1}, "at least 1"),
        ({"n": 1, "seed": -1}, "the seed is -1"),
        ({"n": 1, "bands": "grey"}, "mono, rgb"),
        ({"n": 1, "quality": "best"}, "draft, default, high"),
    ],
)
def test_a_recipes_plan_refuses_options(options, says):
    with pytest.raises(fa.UserError, match=says):
        fa.plan_recipe("eval-black", **options)


def test_numbers_of_numpy_are_numbers(scenario):
    plan = fa.plan_flight(scenario, n=np.int64(2), seed=np.uint32(5))
    assert (plan.n_frames, plan.seed) == (2, 5)
    assert camera(width_px=np.int32(64)).width_px == 64


@pytest.mark.parametrize("place", [{"frame": 2}, {"frame": -1}, {"index": -1}])
def test_a_scene_of_a_frame_that_the_plan_lacks_is_refused(scenario, place):
    plan = fa.plan_flight(scenario, n=2)
    with pytest.raises(fa.UserError, match="frames 0 to 1"):
        fa.scene_at(plan, UNIT, AHEAD, **place)


@pytest.mark.parametrize(
    ("part", "says"),
    [
        ({"sensor": fa.Sensor(bits=40)}, "sensor.bits"),
        ({"sensor": fa.Sensor(gaussian_variance=-1.0)}, "sensor.gaussian_variance"),
        ({"sensor": fa.Sensor(blur_sigma_px=NAN)}, "sensor.blur_sigma_px"),
        ({"environment": fa.Environment(atmosphere_thickness_km=NAN)}, "atmosphere_thickness_km"),
        ({"environment": fa.Environment(aerosol_optical_depth=9.0)}, "aerosol_optical_depth"),
        ({"exposure_s": 0.0}, "exposure_s"),
        ({"t_camera_from_target_m": (0.0, 0.0, 1e9)}, "t_camera_from_target_m"),
    ],
)
def test_a_scene_with_a_number_out_of_range_is_not_drawn(scenario, part, says):
    plan = fa.plan_flight(scenario, n=1)
    with pytest.raises(fa.UserError, match=f"cannot be drawn: .*{says}"):
        fa.render_scene(replace(plan.scene(0), **part), plan.target)
