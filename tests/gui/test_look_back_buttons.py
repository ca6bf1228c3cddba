"""Looking back: buttons beside the timeline, at fixed places, and keys that pair."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.harness.pointer import Pointer


@pytest.fixture(params=[(1280, 800), (720, 600)], ids=["wide", "narrow"])
def at(request: pytest.FixtureRequest) -> Iterator[Pointer]:
    made = Pointer("tango-vbar-approach", request.param, panels=False)
    made.console.session.clock.set_rate(10.0)
    for _ in range(20):
        made.console.pass_time(100)
    made.turn()
    yield made
    made.close()


def places(at: Pointer) -> dict[str, tuple[float, float]]:
    """Return the places of the strip's controls by the names of their commands."""
    return {n.label.partition("###")[2]: n.middle for n in at.window.noted if "###time" in n.label}


def test_the_buttons_keep_their_places(at: Pointer) -> None:
    now = places(at)
    assert {"timeline.end ", "timeline.fly-on "} <= now.keys()
    at.console.do("timeline.seek", 5.0)
    at.turn()
    assert places(at) == now
    for name in ("timeline.end ", "timeline.fly-on "):
        assert 0 < now[name][0] < at.window.size[0]


def test_they_act_only_while_looking_back(at: Pointer) -> None:
    place = places(at)["timeline.end "]
    lines = len(at.console.log.lines)
    at.click(place)
    assert len(at.console.log.lines) == lines
    at.console.do("timeline.seek", 5.0)
    at.turn()
    at.click(place)
    assert at.console.session.t_s == pytest.approx(20.0)


def test_flying_on_begins_at_1x_and_says_so(at: Pointer) -> None:
    at.console.do("timeline.seek", 5.0)
    at.turn()
    at.click(places(at)["timeline.fly-on "])
    session = at.console.session
    assert (session.look_back.active, session.clock.paused, session.clock.rate) == (False, False, 1.0)
    assert "flies on from T+00:00:05.0 at 1x" in at.console.messages[-1].text


def test_home_and_end_are_the_ends_of_the_timeline(at: Pointer) -> None:
    keys = {key: c.name for c in at.console.table for key in c.keys}
    assert (keys["home"], keys["end"]) == ("timeline.begin", "timeline.end")
    at.console.press([at.console.table[keys["home"]]])
    assert at.console.session.t_s == 0.0
    assert at.console.session.look_back.active
    at.console.press([at.console.table[keys["end"]]])
    assert at.console.session.t_s == pytest.approx(20.0)
    assert at.console.session.craft.mode == "guidance", "neither changes who flies"
