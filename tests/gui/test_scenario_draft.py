"""A mistake in a scenario's text is told with its line."""

from __future__ import annotations

from importlib.resources import files

import pytest

from flyaround.gui.scenario_draft import ScenarioDraft, line_of
from flyaround.simulator.errors import UserError

TEXT = files("flyaround.assets").joinpath("scenarios", "tango-flyaround.toml").read_text("utf-8")


@pytest.mark.parametrize(
    ("old", "new", "marker", "why"),
    [
        ("duration_s = 60.0", "duration_s = -3.0", "duration_s", "key duration_s is -3"),
        ("exposure_s = 0.0025", "exposur_s = 0.0025", "exposur_s", "did you mean exposure_s"),
        ("radius_m = 9.0\n", "", "[chaser]", "lacks the key radius_m"),
        ("[chaser]", "[chaser", "[chaser", "not valid TOML"),
        ("version = 1", "version = 1\nbogus = 2", "bogus", "unknown key bogus"),
        ('camera = "speed"', 'camera = "sped"', "camera =", "sped"),
        ("altitude_km = 700.0", 'altitude_km = "high"', "altitude_km", "orbit.altitude_km"),
        ('bands = "mono"', 'bands = "grey"', "bands =", "output.bands"),
        ('target = "tango"', 'target = "tangoxx"', "target =", "unknown target"),
        ("altitude_km = 700.0", "altitude_km = -3.0", "altitude_km", "altitude_km"),
        ("epoch_utc = 2026", "epoch_utc = 1026", "epoch_utc", "epoch"),
    ],
)
def test_a_mistake_is_told_with_its_line(old: str, new: str, marker: str, why: str) -> None:
    draft = ScenarioDraft(text=TEXT.replace(old, new, 1))
    assert draft.text != TEXT
    with pytest.raises(UserError) as caught:
        draft.check()
    assert why in draft.problem
    line = next(k for k, row in enumerate(draft.text.splitlines(), 1) if marker in row)
    assert draft.problem.startswith(f"line {line}: ")
    assert str(caught.value) == draft.problem


def test_a_sentence_of_no_key_has_no_line() -> None:
    assert line_of("something else altogether", TEXT) is None
    draft = ScenarioDraft(text="[" * 5000)
    with pytest.raises(UserError):
        draft.check()
    assert not draft.problem.startswith("line")
