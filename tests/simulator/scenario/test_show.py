"""A built-in scenario printed to start from: it flies as it did, and what it offers to add is right."""

import re
import tomllib

import msgspec
import pytest

from flyaround.__main__ import run
from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.load import list_scenarios, load_scenario
from flyaround.simulator.scenario.scenario import Scenario
from flyaround.simulator.scenario.show import show_scenario

_KEY = re.compile(r"# (\w+ = )(?!\.\.\.)(.*?) +# ")


@pytest.mark.parametrize("name", list_scenarios())
def test_it_loads_again_as_the_same_scenario(name, tmp_path):
    path = tmp_path / f"{name}.toml"
    path.write_text(show_scenario(name))
    assert load_scenario(path) == load_scenario(name)


@pytest.mark.parametrize("name", list_scenarios())
def test_the_values_of_keys_that_are_offered_are_those_they_have_anyway(name, tmp_path):
    path = tmp_path / f"{name}.toml"
    # within the sections that the scenario has: comments with a value become keys
    lines, offered = [], False
    for line in show_scenario(name).splitlines():
        offered = line.startswith("# [") or (offered and line != "")
        lines.append(
            line if offered or line.startswith("# [") else re.sub(r"^# (\w+ = )(?!\.\.\.)", r"\1", line)
        )
    path.write_text("\n".join(lines))
    changed, built_in = load_scenario(path), load_scenario(name)
    assert changed == built_in


def test_sections_that_are_offered_have_the_types_of_the_file():
    text = show_scenario("tango-flyaround")
    shown = re.sub(r"^# (\[+[\w.]+\]+|\w+ = (?!\.\.\.).*)$", r"\1", text, flags=re.MULTILINE)
    raw = tomllib.loads(shown)
    for needs in (
        ("lamp",),
        ("lights",),
        ("second_camera",),
        ("burns",),
        ("faults",),
        ("attitude", "point"),
        ("chaser", "keep_out"),
    ):
        table = raw
        for step in needs[:-1]:
            table = table[step]
        del table[needs[-1]]
    raw["epoch_utc"] = "2026-08-20T09:30:00Z"
    scenario = msgspec.convert(raw, Scenario)
    assert scenario.sensor.auto_exposure is not None
    assert scenario.chaser.thrusters is not None


def test_every_section_and_every_mode_is_named():
    text = show_scenario("tango-flyaround")
    for section in (
        "sensor",
        "sensor.detector",
        "optics",
        "environment",
        "lamp",
        "faults",
        "[faults.camera]",
        "forces",
        "chaser.thrusters",
    ):
        assert f"[{section}]" in text
    assert "# mode: replay, hold, drift," in text
    assert "exposure_s = 0.0025" in text
    assert max(len(line) for line in text.splitlines()) <= 120


def test_what_is_no_built_in_scenario_is_said():
    with pytest.raises(UserError, match="tango-flyaround"):
        show_scenario("tango-flyaruond")


def test_the_list_says_how_to_start_one_of_ones_own(tmp_path, capsys):
    assert run(["scenarios"]) == 0
    assert "flyaround scenarios --show tango-flyaround > mine.toml" in capsys.readouterr().out
    assert run(["scenarios", "--show", "tango-limb"]) == 0
    path = tmp_path / "mine.toml"
    path.write_text(capsys.readouterr().out)
    assert load_scenario(path).title == load_scenario("tango-limb").title
