"""Flights: pointing, rates against finite differences, the label with its centre-of-mass offset, tables."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from flyaround.simulator.camera.detector.sensor import Sensor
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.scene.build import build_scene
from flyaround.simulator.scene.state import TargetRef
from flyaround.simulator.world.attitude.pointing import Pointing
from flyaround.simulator.world.attitude.target_attitude import Attitude
from flyaround.simulator.world.flight.build import TargetStart, propagate_flight
from flyaround.simulator.world.flight.export import fly_table
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from flyaround.simulator.world.guidance.chaser import Chaser
from flyaround.simulator.world.guidance.free_flight import FreeDrift, NaturalCircumnavigation
from flyaround.simulator.world.guidance.paths import ForcedFlyaround, Hold, VbarApproach
from flyaround.simulator.world.orbit.propagation import Elements, state_from_elements
from flyaround.simulator.world.time.instant import Instant

CAMERA = Camera(width_px=1920, height_px=1200, fx_px=3003.41, fy_px=3003.41, cx_px=960, cy_px=600)
COM = (0.01, 0.02, 0.15)
MODES: list[Chaser] = [
    Hold(position_lvlh_m=(7.0, 7.0, 1.0)),
    FreeDrift(position_lvlh_m=(2.0, -9.0, 3.0), velocity_lvlh_m_s=(0.02, 0.05, -0.03)),
    NaturalCircumnavigation(radial_m=6.0, cross_track_m=4.0, phase_deg=30.0),
    VbarApproach(start_m=-30.0, hold_m=-5.0, speed_m_s=0.3),
    ForcedFlyaround(radius_m=3.0, far_radius_m=18.0, period_s=240.0, inclination_deg=23.0, phase_deg=34.0),
]


def flight(mode, pointing=None):
    r, v = state_from_elements(
        Elements(semi_major_axis_m=7078e3, eccentricity=0.002, inclination_rad=1.714, raan_rad=0.3)
    )
    return propagate_flight(
        TargetStart(
            r_eci_m=r,
            v_eci_m_s=v,
            attitude=Attitude(
                frame="eci", q_wxyz=(0.5, -0.5, 0.1, 0.7), rate_deg_s=tuple(np.degrees((0.02, -0.03, 0.01)))
            ),
            inertia_kg_m2=np.diag([2.5, 2.7, 3.9]),
        ),
        msgspec.structs.replace(mode, pointing=pointing or Pointing()),
        epoch=Instant.from_utc("2026-03-20T12:00:00Z"),
        duration_s=60.0,
    )


def scene(f, t):
    return build_scene(
        f.state(t),
        camera=CAMERA,
        sensor=Sensor(),
        exposure_s=0.001,
        target=TargetRef(name="box", sha256="0" * 64),
        com_target_m=COM,
        frame_index=0,
        seed=0,
    )


@pytest.mark.parametrize("mode", MODES, ids=lambda m: type(m).__name__)
def test_centre_of_mass_is_at_the_principal_point(mode):
    f = flight(mode)
    for t in (0.0, 21.3, 60.0):
        s = scene(f, t)
        assert np.allclose(CAMERA.project(s.camera_from_target.apply(COM)), [960, 600], atol=1e-7)
        assert s.camera_from_target.apply(COM)[2] == pytest.approx(f.state(t).range_m)


@pytest.mark.parametrize("mode", MODES, ids=lambda m: type(m).__name__)
def test_label_agrees_with_positions_put_together_another_way(mode):
    s, w = scene(flight(mode), 33.0), flight(mode).state(33.0)
    R_eci_from_target = matrix_from_quat(w.q_eci_from_target_wxyz)
    point = np.array([0.3, -0.2, 0.4])
    # the point's place in space, from the model's origin at minus the centre of mass
    point_eci = np.array(s.r_target_eci_m) + R_eci_from_target @ (point - np.array(COM))
    seen = matrix_from_quat(s.q_camera_from_eci_wxyz) @ (point_eci - np.array(s.r_camera_eci_m))
    assert np.allclose(s.camera_from_target.apply(point), seen, atol=5e-9, rtol=0)


@pytest.mark.parametrize("mode", MODES, ids=lambda m: type(m).__name__)
def test_rates_are_the_derivatives_of_the_states(mode):
    turned = Pointing(right_deg=5.7, below_deg=-2.9, roll_deg=40.0)
    f, h = flight(mode, turned), 0.05
    before, now, after = (scene(f, 30.0 + s) for s in (-h, 0.0, h))

    def rate(name):
        return (np.array(getattr(after, name)) - np.array(getattr(before, name))) / (2 * h)

    assert np.allclose(now.v_target_camera_m_s, rate("t_camera_from_target_m"), atol=2e-6, rtol=0)
    assert np.allclose(now.v_camera_eci_m_s, rate("r_camera_eci_m"), atol=1e-5, rtol=0)
    assert np.allclose(now.v_target_eci_m_s, rate("r_target_eci_m"), atol=1e-5, rtol=0)
    R0, R1 = (matrix_from_quat(s.q_camera_from_eci_wxyz).T for s in (before, after))
    spin = matrix_from_quat(now.q_camera_from_eci_wxyz) @ (R1 - R0) / (2 * h)
    assert np.allclose(now.omega_camera_rad_s, [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-6, rtol=0)
    T0, T1 = (matrix_from_quat(s.q_camera_from_target_wxyz) for s in (before, after))
    turn = matrix_from_quat(now.q_camera_from_target_wxyz).T @ (T1 - T0) / (2 * h)
    relative = np.array(now.omega_target_rad_s) - matrix_from_quat(
        now.q_camera_from_target_wxyz
    ).T @ np.array(now.omega_camera_rad_s)
    assert np.allclose(relative, [turn[2, 1], turn[0, 2], turn[1, 0]], atol=1e-5, rtol=0)


def test_offset_puts_the_target_left_of_and_above_the_centre():
    f = flight(MODES[0], Pointing(right_deg=np.degrees(0.1), below_deg=np.degrees(0.05)))
    u, v = CAMERA.project(scene(f, 0.0).camera_from_target.apply(COM))
    assert u < 960
    assert v < 600
    assert u == pytest.approx(960 - 3003.41 * np.tan(0.1) / np.cos(0.05), abs=0.01)


def test_picture_is_down_side_to_the_earth_and_rolls_clockwise():
    level = scene(flight(MODES[0], Pointing(down="nadir")), 0.0)
    rolled = scene(flight(MODES[0], Pointing(down="nadir", roll_deg=90.0)), 0.0)
    # rolled clockwise by a quarter turn, the camera's right side points to the Earth
    for s, to_the_earth in ((level, [0, 1]), (rolled, [1, 0])):
        nadir = -matrix_from_quat(s.q_camera_from_eci_wxyz) @ np.array(s.r_target_eci_m)
        assert np.allclose(nadir[:2] / np.hypot(nadir[0], nadir[1]), to_the_earth, atol=1e-6)


def test_looking_along_the_reference_still_gives_an_attitude():
    above = Hold(position_lvlh_m=(10.0, 0.0, 0.0))
    chosen, forced = flight(above), flight(above, Pointing(down="nadir"))
    assert chosen.pointing.down == "cross_track"
    for f in (chosen, forced):
        s = scene(f, 10.0)
        assert np.allclose(CAMERA.project(s.camera_from_target.apply(COM)), [960, 600], atol=1e-7)
        assert np.linalg.norm(s.omega_camera_rad_s) < 0.01


def test_state_depends_on_the_inputs_alone():
    first, second = flight(MODES[4]), flight(MODES[4])
    first.state(50.0)
    assert first.state(12.5) == second.state(12.5)


def test_table_has_one_row_per_time():
    rows = fly_table(flight(MODES[1]), [0.0, 30.0, 60.0])
    assert [row["t_s"] for row in rows] == [0, 30, 60]
    assert rows[1]["epoch_utc"] == "2026-03-20T12:00:30.000000Z"
    assert rows[0]["position_lvlh_y_m"] == pytest.approx(-9.0)
    assert rows[0]["velocity_lvlh_y_m_s"] == pytest.approx(0.05)
    assert {"q_eci_from_target_w", "omega_camera_z_rad_s", "range_m"} <= set(rows[0])


@pytest.mark.parametrize("guidance", MODES, ids=lambda m: type(m).__name__)
@pytest.mark.parametrize("t_s", [-1.0, 61.0])
def test_no_part_of_a_state_is_told_outside_the_flight(guidance, t_s):
    for told in (flight(guidance).chaser, flight(guidance).state):
        with pytest.raises(ValueError, match="outside the flight"):
            told(t_s)
