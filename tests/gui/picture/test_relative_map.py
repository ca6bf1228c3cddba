"""The LVLH map's geometry: one scale, everything in view in both planes, the same place under the pointer."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flyaround.gui.picture.relative_map import (
    IN_PLANE,
    OUT_OF_PLANE,
    MapLook,
    corridor_outline,
    fit,
    hull,
    metres_text,
    nice_step,
    ports,
    sun_lvlh,
    target_edges_lvlh_m,
)
from flyaround.gui.views.lvlh_map import zoomed
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.world.guidance.keep_out import KeepOut

RECTS = [(10.0, 20.0, 330.0, 180.0), (0.0, 0.0, 260.0, 400.0), (5.0, 5.0, 1200.0, 300.0)]
coordinate = st.floats(-1e4, 1e4)
points = st.lists(st.tuples(coordinate, coordinate, coordinate), min_size=1, max_size=12)


@given(cloud=points, rect=st.sampled_from(RECTS))
def test_a_fitted_map_holds_everything_in_both_planes(
    cloud: list[tuple[float, float, float]], rect: tuple[float, float, float, float]
) -> None:
    look = MapLook()
    first = ports(rect, look)[0].rect
    fit(look, np.array(cloud), first[2] / first[3])
    for port in ports(rect, look):
        for x, y in port.at(cloud):
            assert port.inside(x, y)


def test_a_fitted_map_does_not_swim() -> None:
    look = MapLook()
    cloud = np.array([[0.0, -10.0, 0.0], [0.0, 10.0, 0.0]])
    fit(look, cloud, 1.5)
    kept = (look.centre_lvlh_m, look.width_m)
    fit(look, 0.9 * cloud, 1.5)
    assert (look.centre_lvlh_m, look.width_m) == kept
    fit(look, 0.1 * cloud, 1.5)
    assert look.width_m < 0.5 * kept[1]


@pytest.mark.parametrize("rect", RECTS)
def test_both_axes_of_both_planes_have_one_scale(rect: tuple[float, float, float, float]) -> None:
    for port in ports(rect, MapLook((1.0, 2.0, 3.0), 40.0)):
        unit = port.at(np.vstack([np.zeros(3), np.eye(3)])) - port.at(np.zeros(3))
        right, up = unit[1 + port.plane.right], unit[1 + port.plane.up]
        assert right == pytest.approx([port.scale, 0.0])
        assert up == pytest.approx([0.0, -port.scale])
        assert unit[1 + port.plane.through] == pytest.approx([0.0, 0.0])


@given(x=st.floats(11, 339), y=st.floats(21, 100), factor=st.floats(0.5, 3.0))
def test_zooming_keeps_the_place_under_the_pointer(x: float, y: float, factor: float) -> None:
    look = MapLook((1.0, -2.0, 3.0), 40.0)
    port = next(p for p in ports(RECTS[0], look) if p.plane is IN_PLANE)
    before = port.point(x, y)
    look.place(*zoomed(port, look, (x, y), factor))
    after = next(p for p in ports(RECTS[0], look) if p.plane is IN_PLANE).point(x, y)
    assert after == pytest.approx(before, abs=1e-6)
    assert look.width_m == pytest.approx(40.0 / factor)
    assert look.centre_lvlh_m[2] == 3.0


def test_point_and_place_are_inverse() -> None:
    for port in ports(RECTS[0], MapLook((4.0, 5.0, 6.0), 30.0)):
        p = port.point(100.0, 60.0, through_m=7.0)
        assert port.at(p) == pytest.approx([100.0, 60.0])
        assert p[port.plane.through] == 7.0


def test_the_corridor_is_a_wedge_along_its_axis_and_a_disc_across_it() -> None:
    guard = KeepOut(radius_m=20.0, corridor_axis_lvlh=(0.0, 1.0, 0.0), corridor_half_angle_deg=15.0)
    wedge = corridor_outline(guard, IN_PLANE)
    angle = np.degrees(np.arctan2(wedge[:, 0], wedge[:, 1]))
    assert np.abs(angle[np.linalg.norm(wedge, axis=1) > 1]).max() == pytest.approx(15.0, abs=0.1)
    assert np.linalg.norm(wedge, axis=1).max() == pytest.approx(20.0)
    away = KeepOut(radius_m=20.0, corridor_axis_lvlh=(0.0, 0.0, -1.0), corridor_half_angle_deg=15.0)
    disc = corridor_outline(away, IN_PLANE)
    assert np.linalg.norm(disc[:, :2], axis=1) == pytest.approx(20.0 * np.sin(np.radians(15.0)), rel=0.01)
    assert len(corridor_outline(KeepOut(radius_m=5.0), OUT_OF_PLANE)) == 0


def test_a_hull_is_the_outline_in_order() -> None:
    square = np.array([[0.0, 0.0, 5.0], [1, 1, 0], [1, 0, 0], [0, 1, 9], [0.5, 0.5, 0.5]])
    around = hull(square, IN_PLANE)[:, :2]
    assert len(around) == 4
    area = 0.5 * np.sum(around[:, 0] * np.roll(around[:, 1], -1) - np.roll(around[:, 0], -1) * around[:, 1])
    assert abs(area) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("length", "step", "text"),
    [
        (0.07, 0.05, "5 cm"),
        (1.0, 1.0, "1 m"),
        (5.0, 5.0, "5 m"),
        (49.0, 20.0, "20 m"),
        (7000.0, 5000.0, "5 km"),
    ],
)
def test_the_scale_bar_has_a_round_length(length: float, step: float, text: str) -> None:
    assert nice_step(length) == pytest.approx(step)
    assert metres_text(nice_step(length)) == text


def test_target_and_sun_lie_as_in_the_camera() -> None:
    session = FlightSession.of(load_scenario("tango-vbar-approach"))
    world, frame = session.craft.world, session.flight.lvlh(0.0)
    edges = target_edges_lvlh_m(session.plan.target, world, frame)
    # a craft a metre across about its centre of mass
    assert 0.3 < np.linalg.norm(edges.reshape(-1, 3), axis=1).max() < 2.0
    sun = sun_lvlh(world, frame)
    assert np.linalg.norm(sun) == pytest.approx(1.0)
    # seen from the chaser the angle to the Sun is the phase angle, whatever the axes
    scene = session.scene()
    los = np.array(scene.t_camera_from_target_m)
    here = np.array(world.position_lvlh_m)
    cosine = -los @ np.array(scene.sun_direction_camera) / np.linalg.norm(los)
    assert sun @ here / np.linalg.norm(here) == pytest.approx(cosine, abs=0.02)
