"""A refused entry is a message; only a refusal by the vehicle, and a file that cannot be written, is a caution."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from flyaround.gui import style
from flyaround.gui.console import Console
from flyaround.gui.jobs.hil_session import HilSession
from flyaround.gui.messages import Level
from flyaround.gui.status_line import message_texts
from flyaround.hil.host.run import RunConfig
from tests.harness.flown_console import console_flying
from tests.harness.pointer import Pointer


class Started:
    """A process of a session that does nothing."""


@pytest.fixture
def console() -> Iterator[Console]:
    made = console_flying("tango-vbar-approach")
    yield made
    made.close()


@pytest.mark.parametrize(
    "line",
    [
        "guidance.vbr",
        "time.rate 'a",
        "time.rate 3",
        "guidance.vbar near",
        "scenario.save x",
        "hil.start nowhere",
    ],
)
def test_a_slip_of_the_keyboard_is_no_caution(console: Console, line: str) -> None:
    console.do_line(line)
    assert console.messages.waiting == []
    ((text, colour),) = message_texts(console)
    assert text
    assert colour == style.INK


@pytest.mark.parametrize("line", ["docking.go", "guidance.waypoint 0 0 0", "log.save /dev/null/x"])
def test_what_the_vehicle_refuses_is_one(console: Console, line: str) -> None:
    console.do_line(line)
    assert len(console.messages.waiting) == 1


def test_a_late_second_click_is_no_caution() -> None:
    at = Pointer("tango-space-10m", panels=False)
    at.press("ABORT")
    at.console.clock_ms += 6000
    at.turn()
    assert at.console.messages[-1].text.startswith("not aborted")
    assert at.console.messages.waiting == []
    at.close()


@pytest.mark.parametrize("level", ["note", "caution", "warning"])
def test_a_later_message_outranks_a_refused_number(level: Level) -> None:
    at = Pointer("tango-space-10m", panels=False, opened=("steering",))
    at.type(at.sight("##point0"), "hello")
    at.turn()
    assert any("allowed" in text for text in at.texts())
    for _ in range(2):
        at.console.say("something happened", level)
        at.turn()
        assert any(text.startswith("something happened") for text in at.texts())
        assert not any("allowed" in text for text in at.texts())
    at.type(at.sight("##point1"), "hello")
    at.turn()
    assert any("allowed" in text for text in at.texts()), "the newest refusal is said again"
    at.close()


def test_an_abort_is_said_over_a_refused_number() -> None:
    at = Pointer("tango-space-10m", panels=False, opened=("steering",))
    at.type(at.sight("##point0"), "hello")
    at.press("ABORT")
    at.press("ABORT")
    said = at.console.messages[-1].text
    assert said.startswith("abort: the chaser retreats")
    assert any(text.startswith(said[:30]) for text in at.texts())
    at.close()


def test_a_board_here_begins_the_session(console: Console, monkeypatch: pytest.MonkeyPatch) -> None:
    hil = console.jobs.hil
    started: list[str] = []

    def start(self: HilSession, _: object, config: RunConfig, __: object) -> None:
        started.append(config.link.url)
        self._process = Started()  # type: ignore[assignment]

    monkeypatch.setattr(HilSession, "start", start)
    console.do("hil.board", "hybrid", "tcp://127.0.0.1:5700")
    assert started == ["tcp://127.0.0.1:5700"]
    assert hil.board_running
    assert console.messages.waiting == []
    hil._process = None
    hil.stop_board()
