"""The guard of the keep-out sphere acts as late as braking allows, and no later."""

import numpy as np
import pytest

from flyaround.simulator.world.guidance.command_script import CommandScript, fly_script
from flyaround.simulator.world.guidance.keep_out import KeepOut
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import propagate

RADIUS_M, BRAKE_M_S2, PERIOD_S = 10.0, 0.05, 0.5
SPHERE = KeepOut(radius_m=RADIUS_M)
STILL = np.zeros(3)


def _overruled(p, v, asked=STILL, keep_out=SPHERE):
    return keep_out.guard(np.array(p), np.array(v), np.asarray(asked, float), PERIOD_S, BRAKE_M_S2)[1]


@pytest.mark.parametrize("speed", [0.1, 0.5, 1.5])
@pytest.mark.parametrize("push", [0.0, 0.03])
def test_it_acts_where_braking_would_only_just_stop_outside(speed, push):
    # after the period that the command is held, v^2 / 2 a is the way to a stop
    after = speed + push * PERIOD_S
    needed = speed * PERIOD_S + push * PERIOD_S**2 / 2 + after**2 / (2 * BRAKE_M_S2)
    asked = (0.0, push, 0.0)
    for margin, acts in ((1.02, False), (0.98, True)):
        assert _overruled((0.0, -RADIUS_M - margin * needed, 0.0), (0.0, speed, 0.0), asked) is acts


def test_who_passes_by_or_leaves_is_left_alone():
    assert not _overruled((0.0, -10.5, 0.0), (1.0, 0.0, 0.0))
    assert not _overruled((0.0, -10.1, 0.0), (0.0, -1.0, 0.0))


def test_in_the_corridor_it_acts_where_braking_would_only_just_stop_inside():
    corridor = KeepOut(
        radius_m=RADIUS_M, corridor_axis_lvlh=(0, -1, 0), corridor_half_angle_deg=np.degrees(0.25)
    )
    # 8 m from its tip the cone is 2.04 m wide; from 0.41 m/s a stop takes 1.89 m, from 0.44 m/s 2.16 m
    for sideways, acts in ((0.41, False), (0.44, True)):
        assert _overruled((0.0, -8.0, 0.0), (sideways, 0.0, 0.0), keep_out=corridor) is acts


def test_a_flight_is_overruled_when_it_must_be_and_not_before():
    orbit = propagate((7.078e6, 0.0, 0.0), (0.0, 7504.0, 0.0), 40.0, Gravity(j2=0.0))
    speed, start = 0.5, 25.0
    script = CommandScript(
        position_lvlh_m=(0.0, -start, 0.0),
        velocity_lvlh_m_s=(0.0, speed, 0.0),
        brake_m_s2=BRAKE_M_S2,
        period_s=PERIOD_S,
        keep_out=SPHERE,
    )
    track = fly_script(orbit, script, 1.06e-3)
    braking_m = speed**2 / (2 * BRAKE_M_S2)
    # a period of looking ahead, another of the grid; gravity bends the way by centimetres
    assert track.guarded_s == pytest.approx(
        (start - RADIUS_M - braking_m) / speed - PERIOD_S, abs=2 * PERIOD_S
    )


def test_rounding_adds_no_step_to_a_guarded_flight_inside_the_sphere():
    # 1.05 / 0.15 is above 7, and 7 x 0.15 is 1.05
    orbit = propagate((7.078e6, 0.0, 0.0), (0.0, 7504.0, 0.0), 1.05, Gravity(j2=0.0))
    script = CommandScript(position_lvlh_m=(0.0, -5.0, 0.0), period_s=0.15, keep_out=SPHERE)
    track = fly_script(orbit, script, 1.06e-3)
    assert len(track.times_s) == 7
    assert all(track.overruled)


@pytest.mark.parametrize("period", [0.1, 0.15, 0.3, 0.7])
def test_every_step_of_a_script_has_a_length(period):
    script = CommandScript(position_lvlh_m=(0.0, -25.0, 0.0), period_s=period)
    for n in range(1, 2000):
        for duration in (n * period, round(n * period, 9)):
            times = [*script.times_s(duration), duration]
            assert len(times) == n + 1
            assert np.diff(times).min() > 0.99 * period
