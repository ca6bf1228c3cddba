"""Faults as a section of a scenario: the same keys as in a file, which takes their place."""

import tomllib
from pathlib import Path

import msgspec
import pytest

from flyaround.__main__ import run
from flyaround.cli import hil_host
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.toml_text import to_toml
from flyaround.simulator.scenario.faults import Delay, Disconnect, Faults, StuckPixels
from flyaround.simulator.scenario.load import load_scenario

EXAMPLE = Path(__file__).parents[3] / "examples" / "faulty_flight.toml"


def test_the_example_has_faults_of_camera_and_line():
    faults = load_scenario(EXAMPLE).faults
    assert faults.seed == 9
    assert [type(one) for one in faults.camera][:1] == [StuckPixels]
    assert faults.line[-1] == Disconnect(start_s=50.0)
    assert load_scenario("tango-flyaround").faults is None


def test_a_scenario_with_faults_is_written_as_it_was_read():
    scenario = load_scenario(EXAMPLE)
    document = msgspec.to_builtins(scenario)
    written = tomllib.loads(to_toml({"faults": document["faults"], "name": scenario.name}))
    assert msgspec.convert(written["faults"], Faults) == scenario.faults


def test_a_mistake_in_the_section_names_its_key(tmp_path):
    text = EXAMPLE.read_text()
    path = tmp_path / "mine.toml"
    for wrong, why in (
        (text.replace("share = 0.002", "share = 2.0"), r"faults\.camera.*share"),
        (text.replace('kind = "delay"', 'kind = "dely"'), "dely"),
        (text.replace("end_s = 45.0", "end_s = 4.0"), "ends at 4 s and starts at 40 s"),
        (text.replace("[faults]", "[faults]\nsede = 1"), "sede"),
    ):
        path.write_text(wrong)
        with pytest.raises(UserError, match=why):
            load_scenario(path)


def test_a_file_takes_the_place_of_the_section(tmp_path, monkeypatch):
    class Enough(Exception):  # noqa: N818 - no error
        pass

    taken = []

    def flight(_plan, config, _options):
        taken.append(config.link.faults)
        raise Enough

    monkeypatch.setattr(hil_host, "FlightRun", flight)
    file, none = tmp_path / "faults.toml", tmp_path / "none.toml"
    file.write_text('schema = "flyaround.faults"\nversion = 1\n[[line]]\nkind = "delay"\ndelay_ms = 5.0\n')
    none.write_text("")
    for given in (None, file, none):
        with pytest.raises(Enough):
            run(
                ["hil", "host", str(EXAMPLE), "-n", "2", *([] if given is None else ["--faults", str(given)])]
            )
    assert taken == [load_scenario(EXAMPLE).faults, Faults(line=(Delay(delay_ms=5.0),)), Faults()]
