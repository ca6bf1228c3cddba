"""Planned burns on the map: planned, dragged, moved along the path and cancelled by the pointer, without a window."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from flyaround.gui.console import Console
from flyaround.gui.picture.relative_map import MapLook, ports
from flyaround.gui.views.burn_nodes import ARM, FIRST_M_S, PER_M_S, BurnNodes, arrow_scale, dragged, handle
from flyaround.simulator.piloting.planned_burns import burn_of
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.world.guidance.free_flight import FreeDrift
from tests.harness.flown_console import console_flying

LEFT_DOWN, HELD, RIGHT, NOTHING = (
    (True, True, False),
    (False, True, False),
    (False, False, True),
    (False, False, False),
)


@pytest.fixture
def console() -> Console:
    scenario = msgspec.structs.replace(
        load_scenario("tango-flyaround"), chaser=FreeDrift(position_lvlh_m=(0.0, 50.0, 0.0))
    )
    console = console_flying(scenario)
    console.session.craft.take_over()
    return console


PORTS = ports((0.0, 0.0, 800.0, 400.0), MapLook(width_m=200.0))


@pytest.mark.parametrize("node", [(100.0, 100.0), (792.0, 100.0), (400.0, 3.0)])
@pytest.mark.parametrize("size_m_s", [0.001, 0.05, 1.0, 5.0])
def test_a_handle_lies_inside_the_map_and_is_where_it_was_dragged_to(
    node: tuple[float, float], size_m_s: float
) -> None:
    burn = burn_of(100.0, 0.4 * size_m_s, size_m_s, 0.2 * size_m_s)
    for port in PORTS:
        at = handle(node, burn, port)
        if not port.inside(*node):
            continue
        assert port.inside(*at)
        assert math.dist(at, node) > 1.0
        scale = list(arrow_scale(node, burn, port)[1:])
        again = dragged(burn, port, node, at, (scale[0], scale[1]))
        assert again.delta_v_lvlh_m_s == pytest.approx(burn.delta_v_lvlh_m_s, abs=1.1e-3)
        # where there is room, burns are drawn to one scale
        if size_m_s <= 0.05 and node == (100.0, 100.0):
            assert scale == [ARM, PER_M_S]
    # a burn never becomes none at all
    first = burn_of(1.0, 0.02, 0.0, 0.0)
    assert dragged(first, PORTS[0], (0.0, 0.0), (0.0, 1.0), (ARM, PER_M_S)).size_m_s == 0.02


def test_a_right_click_plans_a_burn_there_and_cancels_it(console: Console) -> None:
    nodes = BurnNodes()
    session = console.session
    drift = session.craft.predicted_burns()
    k = int(np.searchsorted(drift.times_s, 300.0))
    mouse = tuple(float(x) for x in PORTS[0].at(drift.points_lvlh_m[k]))
    assert nodes.take_mouse(console, PORTS, mouse, RIGHT)
    (burn,) = session.craft.steering.burns.burns
    assert burn.t_s == pytest.approx(drift.times_s[k], abs=16.0)
    assert burn.delta_v_lvlh_m_s == (0.0, FIRST_M_S, 0.0)
    node = session.craft.predicted_burns().nodes_lvlh_m[0]
    mouse = tuple(float(x) for x in PORTS[0].at(node))
    assert nodes.take_mouse(console, PORTS, mouse, RIGHT)
    assert session.craft.steering.burns.burns == ()
    assert not nodes.take_mouse(console, PORTS, mouse, NOTHING)


def test_a_handle_is_dragged_by_one_command(console: Console) -> None:
    nodes, session = BurnNodes(), console.session
    console.do("burn.plan", 200.0, 0.0, 0.05, 0.0)
    node = tuple(float(x) for x in PORTS[0].at(session.craft.predicted_burns().nodes_lvlh_m[0]))
    start = handle(node, session.craft.steering.burns.burns[0], PORTS[0])
    before = len(console.log.lines)
    assert nodes.take_mouse(console, PORTS, start, LEFT_DOWN)
    up = (node[0], node[1] - ARM - 0.03 * PER_M_S)
    assert nodes.take_mouse(console, PORTS, up, HELD)
    assert session.craft.steering.burns.burns[0].delta_v_lvlh_m_s == (0.0, 0.05, 0.0)
    assert nodes.take_mouse(console, PORTS, up, NOTHING)
    assert session.craft.steering.burns.burns[0].delta_v_lvlh_m_s == pytest.approx((0.03, 0.0, 0.0), abs=1e-9)
    assert [line.name for line in console.log.lines[before:]] == ["burn.plan"]


def test_a_node_is_moved_along_the_path_to_another_time(console: Console) -> None:
    nodes, session = BurnNodes(), console.session
    console.do("burn.plan", 200.0, 0.0, 0.05, 0.0)
    drift = session.craft.predicted_burns()
    node = tuple(float(x) for x in PORTS[0].at(drift.nodes_lvlh_m[0]))
    k = int(np.searchsorted(drift.times_s, 120.0))
    earlier = tuple(float(x) for x in PORTS[0].at(drift.points_lvlh_m[k]))
    assert nodes.take_mouse(console, PORTS, node, LEFT_DOWN)
    nodes.take_mouse(console, PORTS, earlier, HELD)
    nodes.take_mouse(console, PORTS, earlier, NOTHING)
    (burn,) = session.craft.steering.burns.burns
    assert burn.t_s < 190.0
    assert burn.delta_v_lvlh_m_s == (0.0, 0.05, 0.0)


def test_the_map_keeps_the_mouse_where_no_burn_is(console: Console) -> None:
    nodes = BurnNodes()
    console.do("burn.plan", 200.0, 0.0, 0.05, 0.0)
    assert not nodes.take_mouse(console, PORTS, (20.0, 390.0), LEFT_DOWN)
    assert not nodes.take_mouse(console, PORTS, (-50.0, 10.0), RIGHT)
