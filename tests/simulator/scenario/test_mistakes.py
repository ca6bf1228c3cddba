"""Mistakes in scenario and camera files: each is one sentence that says what is wrong, where and what is allowed."""

import re

import pytest
from scenario_text import GOOD, write

from flyaround.simulator.errors import UserError, near_names
from flyaround.simulator.scenario.load import load_scenario


@pytest.mark.parametrize(
    ("name", "known", "meant"),
    [
        ("bogus", ["burns", "focus"], []),
        ("durations", ["duration_s", "bands"], ["duration_s"]),
        ("fov", ["fx_px", "fov_deg"], ["fov_deg"]),
        ("soyuz", ["tango", "soyuz-ms"], ["soyuz-ms"]),
        ("bnads", ["burns", "bands"], ["bands"]),
        ("x", ["fx_px", "cx_px"], []),
    ],
)
def test_a_name_is_suggested_only_where_it_is_near(name, known, meant):
    assert near_names(name, known) == meant


# what is changed in the good file, and what the sentence must name: key, value, what is allowed
MISTAKES = [
    ("duration_s = 60.0", "duration_s = = 60", ["not valid TOML", "line 3"]),
    ("duration_s = 60.0", "duration_s = -5", ["duration_s", "-5", "more than 0"]),
    ("duration_s = 60.0", "duration_s = nan", ["duration_s", "nan", "finite"]),
    ("duration_s = 60.0", 'duration_s = "long"', ["duration_s", "'long'", "a number of more than 0"]),
    ("duration_s = 60.0", "", ["lacks the key duration_s", "a number of more than 0"]),
    (
        "duration_s = 60.0",
        "durations = 60.0\nduration_s = 60.0",
        ["unknown key durations", "did you mean duration_s"],
    ),
    ("2026-03-20T12:00:00Z", "2026-03-20T12:00:00", ["epoch_utc", "2026-03-20T12:00:00", "Z"]),
    ("2026-03-20T12:00:00Z", '"tomorrow"', ["epoch_utc", "'tomorrow'", "2026-03-20T12:00:00Z"]),
    ("2026-03-20T12:00:00Z", '"1815-06-18T12:00:00Z"', ["epoch_utc", "1815", "1972 to 2099"]),
    ("altitude_km = 700.0", "altitude_km = 7", ["orbit.altitude_km", "is 7", "at least 10"]),
    (
        "altitude_km = 700.0",
        "altitude_km = 700\neccentricity = 0.5",
        ["orbit.eccentricity", "0.5", "lowest point"],
    ),
    (
        "altitude_km = 700.0",
        "altitude_m = 7e5",
        ["unknown key altitude_m", "[orbit]", "did you mean altitude_km"],
    ),
    ("altitude_km = 700.0", "inclination_deg = 98", ["[orbit] lacks the key altitude_km", "at least 10"]),
    ('kind = "elements"', 'kind = "tles"', ["orbit.kind", "'tles'", "elements", "state"]),
    ('kind = "elements"', "", ["[orbit] lacks the key kind", "elements, state"]),
    ('mode = "hold"', 'mode = "holdd"', ["chaser.mode", "'holdd'", "did you mean 'hold'", "flyaround"]),
    (
        "[0, -10, 0]",
        "[0, -10, 0]\n[chaser.thrusters]\nminimum_impulse_ns = 5",
        ["chaser.thrusters.minimum_impulse_ns", "is 5", "at most force_n times period_s, 1", "never fire"],
    ),
    ("[0, -10, 0]", "[0, -10]", ["chaser.position_lvlh_m", "[0, -10]", "a list of 3"]),
    ("[0, -10, 0]", "[0, -10, 1e9]", ["chaser.position_lvlh_m[2]", "1000000000.0", "at most 1000000"]),
    ("[0, -10, 0]", "[0, -0.2, 0]", ["[chaser]", "0.2 m", "at least 1.5 m", "minimum_start_range_m"]),
    (
        "[0, -10, 0]",
        "[0, -10, 0]\npointing = { roll = 5 }",
        ["unknown key roll", "[chaser.pointing]", "roll_deg"],
    ),
    ('camera = "speed"', 'camera = "sped"', ["key camera", "'sped'", "did you mean speed"]),
    ('camera = "speed"', "camera = 5", ["key camera", "is 5", "text in quotes", "width_px"]),
    ('camera = "speed"', "camera = { width_px = 640 }", ["[camera] lacks the key height_px", "at least 16"]),
    ('preset = "speed"', 'preset = "spede"', ["sensor.preset", "'spede'", "did you mean 'speed'", "thesis"]),
    ("stars = true", "stars = 1", ["environment.stars", "is 1", "true or false"]),
    ('bands = "mono"', 'bands = "infrared"', ["output.bands", "'infrared'", "mono", "rgb"]),
    ("[1, 0, 0]", "[1, 0, 0]\nq_wxyz = [1, 1, 0, 0]", ["attitude.q_wxyz", "1.41421", "unit quaternion"]),
    (
        "[1, 0, 0]",
        "[1, 0, 0]\nq_wxyz = [1, 0, 0, 0]\neuler_deg = [0, 0, 0]",
        ["[attitude]", "q_wxyz", "euler_deg", "one of them"],
    ),
    (
        "[1, 0, 0]",
        "[1, 0, 0]\ninertia_kg_m2 = [[1, 0, 0], [0, 1, 0], [0, 0, 9]]",
        ["attitude.inertia_kg_m2", "1, 1, 9", "no rigid body"],
    ),
    ("[output]", "version = 2\n[output]", ["unknown key version", "[environment]"]),
    ("epoch_utc", "version = 2\nepoch_utc", ["key version", "is 2", "allowed: 1"]),
]


@pytest.mark.parametrize(("old", "new", "words"), MISTAKES, ids=[m[1][:40] or f"no {m[0]}" for m in MISTAKES])
def test_a_mistake_is_one_sentence(old, new, words, tmp_path):
    assert old in GOOD
    path = write(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(UserError) as caught:
        load_scenario(path)
    sentence = str(caught.value)
    assert sentence.startswith(str(path))
    assert "\n" not in sentence
    for word in words:
        assert word in sentence
    # nothing of the libraries underneath shows
    assert not re.search(r"\$\.|Struct|msgspec|Object|Traceback", sentence)


@pytest.mark.parametrize(
    ("orbit", "words"),
    [
        ("r_eci_km = [7000, 0, 0]\nv_eci_km_s = [0, 12, 0]", ["orbit.v_eci_km_s", "12.000", "less than"]),
        ("r_eci_km = [6000, 0, 0]\nv_eci_km_s = [0, 7, 0]", ["orbit.r_eci_km", "6000.0", "at least 6478"]),
        ("r_eci_km = [7000, 0, 0]\nv_eci_km_s = [7, 0, 0]", ["orbit.v_eci_km_s", "an orbit, not a fall"]),
        ("r_eci_km = [7000, 0, 0]\nv_eci_km_s = [0, 5, 0]", ["[orbit]", "lowest point", "at least 100 km"]),
    ],
)
def test_an_impossible_state_is_refused(orbit, words, tmp_path):
    text = GOOD.replace('kind = "elements"\naltitude_km = 700.0', f'kind = "state"\n{orbit}')
    with pytest.raises(UserError) as caught:
        load_scenario(write(tmp_path, text))
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("tango-fly", ["'tango-fly'", "did you mean tango-flyaround"]),
        ("zzz", ["'zzz'", "tango-flyaround", "tango-limb"]),
        ("no/such.toml", ["'no/such.toml'", "TOML file"]),
    ],
)
def test_unknown_scenario(name, words):
    with pytest.raises(UserError) as caught:
        load_scenario(name)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("section", "sentence"),
    [
        ("[chaser.keep_out]\nradius_m = 5.0", "needs [chaser.thrusters]"),
        ("[chaser.thrusters]\n[chaser.keep_out]\nradius_m = 50.0", "inside the keep-out sphere"),
        (
            "[chaser.thrusters]\nforce_n = 0.0",
            "chaser.thrusters.force_n is 0.0, allowed: a number of more than 0",
        ),
    ],
)
def test_mistakes_about_thrusters(section, sentence, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        'epoch_utc = 2026-08-20T09:30:00Z\nduration_s = 5.0\norbit = {kind = "elements", altitude_km = 700.0}\n'
        f'[chaser]\nmode = "hold"\nposition_lvlh_m = [0.0, 9.0, 0.0]\n{section}\n'
    )
    with pytest.raises(UserError) as caught:
        load_scenario(path)
    assert sentence in str(caught.value)
