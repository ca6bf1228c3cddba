"""Mission times, durations and speeds have one format each, and a time is read back from it."""

from __future__ import annotations

import pytest

from flyaround.simulator.piloting.docking_figures import JudgedFigure
from flyaround.simulator.piloting.readouts import duration_text, mission_seconds, mission_time, speed_text


@pytest.mark.parametrize(
    ("t_s", "text"),
    [
        (0.0, "T+00:00:00.0"),
        (-0.01, "T+00:00:00.0"),
        (59.96, "T+00:01:00.0"),
        (1512.6, "T+00:25:12.6"),
        (360000.0, "T+100:00:00.0"),
    ],
)
def test_a_mission_time_is_read_back(t_s: float, text: str) -> None:
    assert mission_time(t_s) == text
    assert mission_seconds(text) == pytest.approx(max(t_s, 0.0), abs=0.05)


def test_whole_seconds_are_those_that_have_passed() -> None:
    assert mission_time(61.9, whole=True) == "T+00:01:01"


@pytest.mark.parametrize(
    ("text", "t_s"), [("8:20", 500.0), ("0:08:20.5", 500.5), (" 500 ", 500.0), ("5e2", 500.0), ("-3", -3.0)]
)
def test_a_time_is_typed_in_seconds_or_as_on_a_clock(text: str, t_s: float) -> None:
    assert mission_seconds(text) == t_s


@pytest.mark.parametrize("text", ["", "1:60", "1:2:3:4", "1:-2", "T+", "8:20 s", "a:10"])
def test_other_texts_are_no_time(text: str) -> None:
    with pytest.raises(ValueError, match="could not convert"):
        mission_seconds(text)


@pytest.mark.parametrize(
    ("seconds", "text"), [(3.4, "3 s"), (125, "2 min 05 s"), (3725, "1 h 02 min 05 s"), (59.6, "1 min 00 s")]
)
def test_a_duration_names_its_units(seconds: float, text: str) -> None:
    assert duration_text(seconds) == text


def test_speeds_are_in_one_unit() -> None:
    assert [speed_text(v) for v in (0.00036, 0.05, 1.5)] == ["0.0004 m/s", "0.0500 m/s", "1.5000 m/s"]
    assert speed_text(-0.00001, signed=True) == "+0.0000 m/s"


def test_a_docking_speed_is_as_precise_as_any_other() -> None:
    assert JudgedFigure(name="closing", unit="m/s", value=0.0312, limit=0.1).text == "+0.0312"
    assert JudgedFigure(name="roll", unit="°", value=-0.004, limit=4.0).text == "+0.00"
