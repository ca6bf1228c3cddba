"""The rendering page: rows that need no picture, and the page's shape."""

from simulator.validation import rendering
from simulator.validation.rows import Row


def test_a_missed_goal_shows(tmp_path):
    good = Row(what="a", against="b", unit="km", goal=2.0, measured=1.0)
    bad = Row(what="c", against="d", unit="1", goal=2.0, measured=3.0)
    text = rendering.page([("Part", [good, bad], "Notes.")], "a driver")
    assert "| a | b | 2 km | 1 km | met |" in text
    assert "| c | d | 2 | 3 | **missed** |" in text
    assert text.endswith("Notes.\n")
