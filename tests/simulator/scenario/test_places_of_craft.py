"""No craft flies below the surface, beyond its body's reach or nowhere; its mass is one."""

import pytest
from scenario_text import write

from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

BASE = "epoch_utc = 2026-03-20T12:00:00Z\nduration_s = {duration}\n[orbit]\n{orbit}\n[chaser]\n{chaser}\n"
HOLD = 'mode = "hold"\nposition_lvlh_m = [0.0, -9.0, 0.0]'
LOW = 'kind = "elements"\naltitude_km = 300.0'
STOP = "".join(
    f'\n[[burns]]\ncraft = "target"\nstart_s = {k}.0\ndelta_v_lvlh_m_s = [0.0, {dv}, 0.0]'
    for k, dv in enumerate([-1000.0] * 7 + [-726.0])
)


@pytest.mark.parametrize(
    ("orbit", "chaser", "duration", "sentence"),
    [
        (
            LOW,
            'mode = "hold"\nposition_lvlh_m = [-4e5, 0.0, 0.0]',
            10,
            r"the chaser is below the surface .* 0 s after",
        ),
        (
            LOW,
            'mode = "waypoints"\npoints_lvlh_m = [[0.0, -100.0, 0.0], [-4e5, 0.0, 0.0]]\nspeed_m_s = 100.0',
            6000,
            r"the chaser is below the surface of the Earth 2\d\d\d s after the start",
        ),
        (
            LOW,
            'mode = "drift"\nposition_lvlh_m = [0.0, -9.0, 0.0]\nvelocity_lvlh_m_s = [0.0, -1e3, 0.0]',
            3000,
            "chaser is below",
        ),
        (LOW, HOLD + STOP, 3000, "cannot be integrated beyond|the target is below the surface"),
        (
            'kind = "elements"\naltitude_km = 120.0',
            HOLD + "\n[forces]\ndrag = true\n[forces.target]\nmass_kg = 1.0\narea_m2 = 10.0",
            6000,
            r"the air has brought a craft down to 80 km 2\d\d s after the start",
        ),
        (
            'kind = "elements"\ncentre = "moon"\naltitude_km = 5e4\neccentricity = 0.5',
            HOLD,
            10,
            "highest point at 77606 km from the centre of the Moon, allowed: at most 66100 km",
        ),
        (
            'kind = "state"\nr_eci_km = [1e6, 0.0, 0.0]\nv_eci_km_s = [0.0, 0.5, 0.0]',
            HOLD,
            10,
            "at most 925000 km",
        ),
    ],
)
def test_a_craft_that_is_nowhere_is_refused(orbit, chaser, duration, sentence, tmp_path):
    path = write(tmp_path, BASE.format(orbit=orbit, chaser=chaser, duration=float(duration)))
    with pytest.raises(UserError, match=sentence):
        plan_flight(load_scenario(path), n=2)


KEEPING = 'mode = "keep_range"\nposition_lvlh_m = [0.0, 9.0, 0.0]\nnear_m = 5.0\nfar_m = 20.0\n'
THRUSTERS = HOLD + "\n[chaser.thrusters]\n"


@pytest.mark.parametrize(
    ("chaser", "mass_kg"),
    [
        (HOLD, 100.0),
        (HOLD + "\n[forces.chaser]\nmass_kg = 1000.0", 1000.0),
        (THRUSTERS + "[forces.chaser]\nmass_kg = 1000.0", 1000.0),
        (THRUSTERS + "mass_kg = 300.0", 300.0),
        (THRUSTERS + "mass_kg = 300.0\n[forces.chaser]\nmass_kg = 300.0", 300.0),
        (KEEPING + "[forces.chaser]\nmass_kg = 7.0", 7.0),
    ],
)
def test_a_chaser_has_one_mass(chaser, mass_kg, tmp_path):
    """What thrusters push, the console burns from and air slows is the same."""
    scenario = load_scenario(write(tmp_path, BASE.format(orbit=LOW, chaser=chaser, duration=10.0)))
    assert scenario.chaser_thrusters.mass_kg == mass_kg
    acting = scenario.chaser.acting_thrusters
    assert acting is None or acting.mass_kg == mass_kg


def test_two_masses_of_a_chaser_are_refused(tmp_path):
    chaser = THRUSTERS + "mass_kg = 300.0\n[forces.chaser]\nmass_kg = 1000.0"
    with pytest.raises(UserError, match=r"chaser.thrusters.mass_kg is 300 and forces.chaser.mass_kg 1000"):
        load_scenario(write(tmp_path, BASE.format(orbit=LOW, chaser=chaser, duration=10.0)))


def test_the_built_in_flight_past_the_limb_has_one_mass():
    assert load_scenario("iss-orbit-limb").chaser_thrusters.mass_kg == 1000.0
