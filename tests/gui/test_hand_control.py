"""Hand control by keys at several frame rates of the window, in simulated time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from flyaround.gui.app import ConsoleLoop, Request, command_table, options_of
from flyaround.gui.console import Console
from flyaround.gui.layout import SavedLayout
from flyaround.gui.panels.all import PANELS
from flyaround.gui.picture.feed import Feed
from flyaround.simulator.frame import Frame
from flyaround.simulator.loop import FrameRequest
from flyaround.simulator.piloting.control_laws import ACCELERATION_M_S2
from flyaround.simulator.piloting.orders import PilotCommand
from flyaround.simulator.piloting.session import FlightSession, FlightState
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from tests.harness.simulated_window import SimulatedWindow

RATES_HZ = (5.0, 10.0, 30.0)
ARMED_S, PUSH_S, PUSHED_S = 0.5, 2.0, 4.0


class BlankPictures:
    """Finishes a black picture of each request at once."""

    def __init__(self) -> None:
        self.done: list[Frame] = []

    def submit(self, request: FrameRequest) -> bool:
        image = np.zeros((30, 48), np.uint8)
        self.done.append(Frame(request.scene, image, image.astype(np.float32), stage_ms={"render": 5.0}))
        return True

    def finished(self) -> list[Frame]:
        done, self.done = self.done, []
        return done


Flown = tuple[Console, dict[str, list[float]]]
Fly = Callable[..., Flown]


@pytest.fixture
def fly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Fly:
    """Run the console's loop on keys; return it and the times of each line of its log."""
    monkeypatch.setenv("FLYAROUND_CONSOLE_LAYOUT", str(tmp_path / "layout.json"))
    # panels take time and no part
    closed = SavedLayout(shown=dict.fromkeys((p.name for p in PANELS), False), tour_seen=True)
    (tmp_path / "layout.json").write_bytes(msgspec.json.encode(closed))
    plan = plan_flight(load_scenario("tango-space-10m"), n=1)

    def run(
        hz: float,
        keys: Callable[[SimulatedWindow], Any],
        *,
        armed: bool = True,
        duration_s: float = 7.5,
        session: FlightSession | None = None,
    ) -> Flown:
        window = SimulatedWindow(hz, duration_s)
        session = session or FlightSession(plan)
        feed = Feed(BlankPictures(), clock=lambda: window.seconds)
        console = Console(session, feed, options_of(session), command_table())
        if armed:
            window.hold("h", ARMED_S, 0.1, ctrl=True)
        keys(window)
        try:
            ConsoleLoop(window, console, Request(scenario="tango-space-10m", seconds=1e6)).run()
        finally:
            console.close()
            window.close()
        times: dict[str, list[float]] = {}
        for line in console.log.lines:
            name = line.name if line.verb == "do" else f"{line.verb} {line.name}"
            times.setdefault(name, []).append(line.t_ms / 1000)
        return console, times

    return run


@pytest.mark.parametrize("hz", RATES_HZ)
def test_a_key_pushes_as_long_as_it_is_held_and_abort_follows_at_once(fly: Fly, hz: float) -> None:
    def keys(window: SimulatedWindow) -> None:
        window.hold("w", PUSH_S, PUSHED_S)
        window.hold("delete", PUSH_S + PUSHED_S + 0.2, 0.1)

    console, times = fly(hz, keys)
    (begun,), (ended,) = times["hold steer.forward"], times["release steer.forward"]
    assert ended - begun == pytest.approx(PUSHED_S, abs=2.5 / hz)
    (aborted,) = times["docking.abort"]
    assert aborted <= PUSH_S + PUSHED_S + 0.2 + 2.5 / hz
    assert console.session.craft.steering.doing == "abort"


@pytest.mark.parametrize("hz", RATES_HZ)
def test_abort_overtakes_keys_that_wait(fly: Fly, hz: float) -> None:
    def keys(window: SimulatedWindow) -> None:
        for k in range(20):
            window.hold("w", PUSH_S + 0.05 * k, 0.02)
        window.hold("delete", PUSH_S + 1.0, 0.1)

    console, times = fly(hz, keys, duration_s=4.0)
    assert times["docking.abort"][0] <= PUSH_S + 1.0 + 2.5 / hz
    assert max(times["hold steer.forward"]) <= times["docking.abort"][0]
    assert console.session.craft.steering.doing == "abort"


@pytest.mark.parametrize("hz", RATES_HZ)
def test_stop_is_not_cancelled_by_a_key_that_is_still_held(fly: Fly, hz: float) -> None:
    def keys(window: SimulatedWindow) -> None:
        window.hold("w", PUSH_S, 5.0)
        window.hold("x", PUSH_S + 1.0, 0.1)

    console, times = fly(hz, keys, duration_s=5.0)
    assert times["steer.stop"][0] <= PUSH_S + 1.0 + 2.5 / hz
    # what one second of thrust costs, and as much for the brake
    assert console.session.craft.steering.propellant.delta_v_m_s < 2 * ACCELERATION_M_S2 * (1.0 + 5 / hz)


@pytest.mark.parametrize("hz", RATES_HZ)
def test_thrust_ends_when_the_focus_is_lost(fly: Fly, hz: float) -> None:
    def keys(window: SimulatedWindow) -> None:
        window.hold("w", PUSH_S, 6.0)
        window.lose_focus(PUSH_S + 1.0)

    _, times = fly(hz, keys, duration_s=4.0)
    assert times["release steer.forward"][0] <= PUSH_S + 1.0 + 2.5 / hz


@pytest.mark.parametrize("hz", RATES_HZ)
def test_a_key_tapped_between_two_frames_pushes_once(fly: Fly, hz: float) -> None:
    console, times = fly(hz, lambda window: window.hold("w", PUSH_S + 0.01, 0.02), duration_s=3.5)
    assert len(times["hold steer.forward"]) == len(times["release steer.forward"]) == 1
    assert 0 < console.session.craft.steering.propellant.delta_v_m_s < ACCELERATION_M_S2 * 2.5 / hz


def test_letters_do_not_fly_until_hand_control_is_armed(fly: Fly) -> None:
    def typed(window: SimulatedWindow) -> None:
        for k, key in enumerate("wadx"):
            window.hold(key, PUSH_S + 0.3 * k, 0.2)

    console, times = fly(10.0, typed, armed=False, duration_s=4.0)
    assert console.session.craft.mode == "guidance"
    assert set(times) <= {"window.quit", "window.close"}
    assert "arm hand control" in console.messages[-1].text


def test_abort_needs_no_arming(fly: Fly) -> None:
    console, _ = fly(10.0, lambda window: window.hold("delete", PUSH_S, 0.1), armed=False, duration_s=4.0)
    assert console.session.craft.steering.doing == "abort"


def test_the_windows_close_button_asks_and_a_second_time_closes(fly: Fly) -> None:
    begun: list[SimulatedWindow] = []

    def keys(window: SimulatedWindow) -> None:
        begun.append(window)
        window.hold("w", PUSH_S, 0.5)

    console, times = fly(10.0, keys, duration_s=4.0)
    assert times["window.quit"] == sorted(times["window.quit"])
    assert len(times["window.quit"]) == 2
    # the flight stands still while the question is open
    assert times["window.close"] == times["window.quit"][1:]
    assert begun[0].asked_s < begun[0].seconds
    assert console.window.close


@pytest.mark.parametrize("hz", RATES_HZ)
def test_a_short_click_acts_once_however_slow_the_window(fly: Fly, hz: float) -> None:
    def clicks(window: SimulatedWindow) -> None:
        window.click("Pause", PUSH_S)
        window.click("Play", PUSH_S + 1.5)
        window.click("Pause", PUSH_S + 3.0)

    console, times = fly(hz, clicks, duration_s=6.0)
    assert len(times["time.pause"]) == 3
    for done_s, clicked_s in zip(times["time.pause"], (PUSH_S, PUSH_S + 1.5, PUSH_S + 3.0), strict=True):
        assert 0 <= done_s - clicked_s <= 4.5 / hz + 0.1
    assert console.session.clock.paused


@pytest.mark.parametrize("hz", RATES_HZ)
def test_escape_closes_a_list_and_the_next_click_counts(fly: Fly, hz: float) -> None:
    def operate(window: SimulatedWindow) -> None:
        window.hold("f1", PUSH_S, 0.05)
        window.hold("escape", PUSH_S + 1.5, 0.05)
        window.click("Pause", PUSH_S + 3.0)

    console, times = fly(hz, operate, duration_s=6.5)
    assert len(times["panel.keys"]) == 2
    assert not console.shown["keys"]
    assert len(times["time.pause"]) == 1


def test_a_flight_that_costs_more_than_it_lasts_leaves_the_window_quick(fly: Fly) -> None:
    """Each second of the operator's takes twenty of processing, as an autopilot at 1000x on a busy machine."""
    windows: list[SimulatedWindow] = []
    stepped_s: list[float] = []

    class Costly(FlightSession):
        def step(self, command: PilotCommand, dt_s: float) -> FlightState:
            stepped_s.append(windows[0].seconds)
            windows[0].seconds += 20.0 * dt_s
            return super().step(command, dt_s)

    costly = Costly(plan_flight(load_scenario("tango-space-10m"), n=1))
    fly(10.0, windows.append, armed=False, session=costly)
    waits = np.diff(stepped_s)
    # the first frame does not know it yet
    assert waits[:3].max() > 1.0
    assert waits[5:].max() < 0.4


def test_a_field_that_ends_hand_control_says_so(fly: Fly) -> None:
    console, _ = fly(10.0, lambda window: window.hold("f1", PUSH_S, 0.1), duration_s=4.0)
    assert not console.hand.armed
    assert any("text field; HAND: OFF arms it" in message.text for message in console.messages)
