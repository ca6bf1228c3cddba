"""Every way to move and turn, from a scenario file: it flies, and what contradicts itself is one sentence."""

import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.flight import fly
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_rotvec
from flyaround.simulator.world.messages.aem import write_aem
from flyaround.simulator.world.time.instant import Instant

TANGO = load_target("tango")
HEAD = """
epoch_utc = "2026-03-21T10:00:00Z"
duration_s = 40.0
[orbit]
kind = "elements"
altitude_km = 700.0
inclination_deg = 98.0
"""
HOLD = '[chaser]\nmode = "hold"\nposition_lvlh_m = [0.0, -12.0, 0.0]\n'
DRIFT = '[chaser]\nmode = "drift"\nposition_lvlh_m = [0.0, -12.0, 0.0]\n'
ELLIPSE = '[chaser]\nmode = "safe_ellipse"\nradial_m = 9.0\ncross_track_m = 7.0\n'
STEERED = """[chaser]
mode = "steered"
position_lvlh_m = [0.0, -20.0, 0.0]
commands = [{ start_s = 0.0, duration_s = 10.0, acceleration_m_s2 = [0.0, 0.01, 0.0] }]
"""
POINT = (
    '[attitude]\nmotion = "point"\n[attitude.point]\naxis = [0, 0, 1]\nat = "sun"\nsecond_axis = [1, 0, 0]\n'
)
BURN = '[[burns]]\ncraft = "{craft}"\nstart_s = {start}\ndelta_v_lvlh_m_s = [0.0, 0.1, 0.0]\n'


def written(folder, text):
    path = folder / "mine.toml"
    path.write_text(HEAD + text)
    return path


def flown(folder, text):
    return fly(load_scenario(written(folder, text)), TANGO)


def test_safe_ellipse_and_steered_fly(tmp_path):
    x, y, z = flown(tmp_path, ELLIPSE).state(0.0).position_lvlh_m
    assert (x, y, z) == pytest.approx((9.0, 0.0, 0.0), abs=1e-9)
    steered = flown(tmp_path, STEERED)
    assert steered.state(10.0).velocity_lvlh_m_s[1] == pytest.approx(0.1, abs=1e-3)
    seen = -matrix_from_quat(steered.state(33.3).q_camera_from_eci_wxyz) @ np.array(
        steered.state(33.3).relative_eci_m
    )
    assert np.hypot(seen[0], seen[1]) < 1e-9


def test_motions_of_the_target(tmp_path):
    sun = flown(tmp_path, HOLD + POINT + 'second_at = "cross_track"\n').state(20.0)
    to_sun = np.subtract(sun.r_sun_eci_m, sun.r_target_eci_m)
    axis = matrix_from_quat(sun.q_eci_from_target_wxyz)[:, 2]
    assert axis @ to_sun / np.linalg.norm(to_sun) == pytest.approx(1.0)
    spin = flown(tmp_path, HOLD + '[attitude]\nmotion = "spin"\nrate_deg_s = [0.0, 3.0, 0.0]\n')
    assert spin.state(20.0).omega_target_rad_s == pytest.approx((0.0, np.radians(3.0), 0.0))
    rest = flown(tmp_path, HOLD + '[attitude]\nmotion = "fixed"\neuler_deg = [10.0, 0.0, 0.0]\n')
    in_lvlh = [rest.lvlh(t).R_eci_from_lvlh.T @ matrix_from_quat(rest.attitude(t)[0]) for t in (0.0, 40.0)]
    assert np.allclose(in_lvlh[0], in_lvlh[1], atol=1e-9)


def test_attitude_file_is_followed(tmp_path):
    start = Instant.from_utc("2026-03-21T09:59:00Z")
    times = np.arange(0.0, 181.0, 10.0)
    q = [quat_from_rotvec([0.0, 0.0, 0.02 * t + 1e-4 * t * t]) for t in times]
    stamps = [start.plus(float(t)).iso() for t in times]
    (tmp_path / "a.aem").write_text(
        write_aem(name="T", body_frame="SC_BODY_1", epochs_utc=stamps, q_eci_from_body_wxyz=q)
    )
    flight = flown(tmp_path, HOLD + '[attitude]\nmotion = "aem"\naem_file = "a.aem"\n')
    # the rate rises as the file has it, and does not stay what it was at the epoch
    for t in (0.0, 17.0, 40.0):
        assert flight.state(t).omega_target_rad_s[2] == pytest.approx(0.02 + 2e-4 * (t + 60.0), abs=1e-6)
    # an operator may fly on after the file's end: it turns on as it did
    longer = fly(load_scenario(tmp_path / "mine.toml"), TANGO, 300.0)
    assert longer.state(250.0).omega_target_rad_s == pytest.approx(flight.state(40.0).omega_target_rad_s)


def test_burn_of_the_target_is_seen_from_the_chaser(tmp_path):
    flight = flown(tmp_path, DRIFT + BURN.format(craft="target", start=5.0))
    gain = np.subtract(flight.state(5.0).velocity_lvlh_m_s, flight.state(4.999).velocity_lvlh_m_s)
    assert gain == pytest.approx((0.0, -0.1, 0.0), abs=1e-4)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            HOLD + BURN.format(craft="chaser", start=5.0),
            r"burns\[0\].craft is chaser, but the chaser's mode moves",
        ),
        (DRIFT + BURN.format(craft="chaser", start=50.0), r"burns\[0\] ends 50 s after the start, allowed"),
        (
            ELLIPSE + "[chaser.keep_out]\nradius_m = 8.0\n",
            "within 7 m of the along-track axis, allowed: at least 8 m",
        ),
        (STEERED + "[chaser.thrusters]\n", "chaser's mode is steered by accelerations"),
        (STEERED + "tracking = false\n[chaser.wheels]\n", "chaser.tracking is false"),
        (
            STEERED + "[chaser.keep_out]\nradius_m = 30.0\n",
            "starts 20 m from the target, inside the keep-out sphere",
        ),
        (HOLD + "[chaser.wheels]\ninertia_kg_m2 = [1, 1, 5]\n", "wheels.inertia_kg_m2: no rigid body"),
        (HOLD + "[chaser.wheels]\nperiod_s = 5.0\n", "wheels.period_s is 5, allowed with this bandwidth"),
        (HOLD + '[attitude]\nmotion = "spin"\n', "allowed: the rate and axis of the spin"),
        (
            HOLD + '[attitude]\nmotion = "aem"\n',
            "motion is aem, and motion aem and key attitude.aem_file require",
        ),
        (HOLD + '[attitude]\nmotion = "point"\n', r"motion point and section \[attitude.point\] require"),
        (HOLD + POINT + 'second_at = "sun"\n', "are sun and sun, allowed: two different"),
        (
            HOLD + POINT.replace("[1, 0, 0]", "[0, 0, 2]") + 'second_at = "nadir"\n',
            "must be two directions apart",
        ),
        (
            HOLD + '[attitude]\nmotion = "fixed"\ngravity_gradient = true\n',
            "has a torque, but attitude.motion is fixed",
        ),
        (
            HOLD + "[attitude]\ninertia_kg_m2 = [[1, 0, 0], [0, 1, 0], [0, 0, 9]]\n",
            "no rigid body has principal moments 1, 1, 9",
        ),
    ],
)
def test_contradictions_are_one_sentence(tmp_path, text, sentence):
    with pytest.raises(UserError, match=sentence):
        load_scenario(written(tmp_path, text))
