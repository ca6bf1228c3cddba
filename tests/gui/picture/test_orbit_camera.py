"""The free camera: where it stands, that its picture is of the same world, and where the chaser is in it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flyaround.gui.picture.orbit_camera import (
    FARTHEST_M,
    LARGEST_PX,
    NEAREST_M,
    OrbitCamera,
)
from flyaround.gui.picture.orbit_picture import chaser_marks, orbit_scene, seen_from
from flyaround.gui.picture.view_settings import ViewSettings
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scene.limits import scene_problem
from flyaround.simulator.world.frames.rotation import matrix_from_quat


@pytest.fixture(scope="module")
def session() -> FlightSession:
    return FlightSession.of(load_scenario("tango-vbar-approach"))


def settings_of(session: FlightSession) -> ViewSettings:
    return ViewSettings(bands="mono", environment=session.scene().environment)


angle = st.floats(-400, 400)


@given(azimuth=angle, elevation=angle, distance=st.floats(0, 1e6))
def test_it_stays_within_reach(azimuth: float, elevation: float, distance: float) -> None:
    look = OrbitCamera()
    look.place(azimuth, elevation, distance)
    assert -180 <= look.azimuth_deg < 180
    assert abs(look.elevation_deg) < 90
    assert NEAREST_M <= look.distance_m <= FARTHEST_M
    assert np.linalg.norm(look.from_focus_lvlh) == pytest.approx(1.0)


@pytest.mark.parametrize("about", ["target", "chaser"])
@pytest.mark.parametrize("azimuth", [-150.0, 0.0, 70.0])
@pytest.mark.parametrize("elevation", [-89.0, 0.0, 40.0])
def test_what_it_circles_is_in_the_middle_and_radial_is_up(
    session: FlightSession, about: str, azimuth: float, elevation: float
) -> None:
    look = OrbitCamera("target" if about == "target" else "chaser")
    look.place(azimuth, elevation, 9.0)
    world, frame = session.craft.world, session.flight.lvlh(session.t_s)
    seen = seen_from(world, frame, look)
    R = matrix_from_quat(seen.q_camera_from_eci_wxyz)
    focus = np.zeros(3) if about == "target" else np.array(world.relative_eci_m)
    assert R @ (focus - np.array(seen.relative_eci_m)) == pytest.approx([0, 0, 9.0], abs=1e-9)
    up = R @ frame.R_eci_from_lvlh[:, 0]
    assert up[0] == pytest.approx(0.0, abs=1e-12)
    assert up[1] < 0
    # at rest beside the target in LVLH
    _, v = frame.from_eci(np.array(seen.relative_eci_m), np.array(seen.relative_eci_m_s))
    assert v == pytest.approx(np.zeros(3), abs=1e-12)


def test_from_the_chasers_place_it_sees_what_the_chaser_sees(session: FlightSession) -> None:
    scene = session.scene()
    world, frame = session.craft.world, session.flight.lvlh(session.t_s)
    p = np.array(world.position_lvlh_m)
    look = OrbitCamera()
    look.place(
        float(np.degrees(np.arctan2(p[2], -p[1]))),
        float(np.degrees(np.arcsin(p[0] / np.linalg.norm(p)))),
        float(np.linalg.norm(p)),
    )
    seen = seen_from(world, frame, look)
    assert np.array(seen.relative_eci_m) == pytest.approx(np.array(world.relative_eci_m), abs=1e-6)
    made = orbit_scene(session, settings_of(session), look, 1, "draft")
    assert np.linalg.norm(made.t_camera_from_target_m) == pytest.approx(
        np.linalg.norm(scene.t_camera_from_target_m), abs=1e-6
    )
    assert scene_problem(made) == scene_problem(scene)
    assert (made.target, made.r_sun_eci_m, made.epoch_utc) == (
        scene.target,
        scene.r_sun_eci_m,
        scene.epoch_utc,
    )


def test_the_chaser_is_drawn_where_it_is(session: FlightSession) -> None:
    look = OrbitCamera("chaser")
    scene = orbit_scene(session, settings_of(session), look, 1, "draft")
    frame = session.flight.lvlh(session.t_s)
    trail = np.array([session.craft.world.position_lvlh_m, (0.0, 0.0, 0.0)])
    marks = chaser_marks(scene, session.craft.world, session.plan.camera, frame, trail)
    middle = [(look.size_px[0] - 1) / 2, (look.size_px[1] - 1) / 2]
    assert marks.place == pytest.approx(middle, abs=1e-6)
    assert marks.trail[0] == pytest.approx(middle, abs=1e-3)
    # the trail's end is the target's centre of mass
    com = scene.camera_from_target.apply(np.array([session.plan.target.mass.com_m]))
    assert marks.trail[1] == pytest.approx(scene.camera.project(com)[0], abs=1e-3, nan_ok=True)
    assert marks.range_m == pytest.approx(look.distance_m)
    assert marks.frustum.shape == (8, 2, 2)
    assert np.isfinite(marks.frustum).all()


def test_a_view_of_any_size_gives_a_picture_of_its_form() -> None:
    look = OrbitCamera()
    look.fill(3000.0, 1000.0)
    assert look.size_px[0] <= LARGEST_PX[0]
    assert look.size_px[0] / look.size_px[1] == pytest.approx(3.0, rel=0.06)
    look.fill(1.0, 1.0)
    assert min(look.size_px) >= 64


def test_its_exposure_is_metered(session: FlightSession) -> None:
    settings = settings_of(session)
    near = orbit_scene(session, settings, OrbitCamera(), 1, "draft")
    settings.exposure_stops = 1.0
    brighter = orbit_scene(session, settings, OrbitCamera(), 1, "draft")
    assert brighter.exposure_s == pytest.approx(2 * near.exposure_s)
    assert 1e-5 <= near.exposure_s < 0.25


@pytest.mark.parametrize("range_m", [3.0, 40.0, 900.0])
@pytest.mark.parametrize("way", [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])
def test_it_keeps_a_chaser_in_view_wherever_that_flies(range_m: float, way: tuple[int, int, int]) -> None:
    look = OrbitCamera()
    look.reset(10.0)
    look.place(look.azimuth_deg + 40.0, 10.0, look.distance_m)
    look.follow(range_m)
    camera_lvlh_m = look.distance_m * look.from_focus_lvlh
    to_chaser = range_m * np.array(way) - camera_lvlh_m
    ahead = -look.from_focus_lvlh
    off_deg = np.degrees(np.arccos(to_chaser @ ahead / np.linalg.norm(to_chaser)))
    assert off_deg < 20.0, "half of the field of view"
    look.place(look.azimuth_deg, 10.0, 5.0)
    look.follow(500.0)
    assert look.distance_m == 5.0, "a distance that was chosen stays"
    look.reset(500.0)
    assert look.distance_m > 500.0
