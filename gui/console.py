"""State and commands of the console, independent of its window: flight, pictures, settings, messages."""

from __future__ import annotations

import shlex
from copy import deepcopy
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from flyaround.gui.jobs.all import Jobs, running_jobs
from flyaround.gui.jobs.scenario_opening import ScenarioOpener
from flyaround.gui.messages import UNWRITABLE, Level, Message, Messages
from flyaround.gui.operator_state import HandControl, Help, WindowRequests
from flyaround.gui.picture.change_text import change_text
from flyaround.gui.picture.settings_history import SettingsHistory
from flyaround.gui.questions import FLOWN, acts_on_chaser, flight_text, question_before
from flyaround.gui.scenario_draft import ScenarioDraft
from flyaround.gui.script import CommandLog, Line, Player, Script
from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.control_laws import SWITCHES
from flyaround.simulator.piloting.flight_list import FlightList
from flyaround.simulator.piloting.readouts import duration_text
from flyaround.simulator.piloting.telemetry import telemetry_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from flyaround.gui.command_table import Command, CommandTable, Value
    from flyaround.gui.picture.feed import Feed
    from flyaround.gui.picture.view_settings import Options
    from flyaround.gui.questions import Question
    from flyaround.simulator.piloting.orders import Order
    from flyaround.simulator.piloting.session import FlightSession
    from flyaround.simulator.piloting.telemetry import Telemetry
    from flyaround.simulator.world.flight.world_state import WorldState

KEPT_RECENT = 6  # number of recent scenarios that are kept
UNARMED = "keys, mouse and gamepad do not fly: arm hand control first (Ctrl+H or Insert)"
STEERING = frozenset(f"steer.{switch}" for switch in SWITCHES)
"""Names of the commands whose keys thrust or rotate."""
LONGEST_TICK_MS = 250
"""Longest step of real time; a stalled window does not catch up."""


@dataclass(eq=False)
class Console:
    """State that commands, views and panels share.

    Parameters
    ----------
    session : FlightSession
        The flight; replaced when another scenario is opened.
    feed : Feed
        Pictures of the chaser's camera.
    options : Options
        The operator's settings.
    table : CommandTable
        All commands.
    feeds : dict of str to Feed, optional
        Feeds of further views, by name.
    shown : dict of str to bool, optional
        Panels and views by name, True if open.
    log : CommandLog, optional
        Commands that were run, with their times.
    messages : Messages, optional
        Messages to the operator.
    opener : ScenarioOpener, optional
        Loads scenarios while the window keeps drawing.
    draft : ScenarioDraft, optional
        Text of the scenario that is being edited.
    help : Help, optional
        State of the panels' help and of the tour.
    window : WindowRequests, optional
        Requests to the window.
    device_index : int or None, optional
        EGL device of the renderer.
    clock_ms : int, optional
        Real time since the first picture; it runs while the flight is paused, too.
    window_hz : float, optional
        Frame rate of the window.
    window_gl : str, optional
        OpenGL driver of the window.
    progress : callable, optional
        Function that returns a text on the render process's preparations; empty without any.
    source : str, optional
        Built-in name or file of the flown scenario; empty if it is in no file.
    recent : list of str, optional
        Built-in names and files of recent scenarios, newest first.
    flights : FlightList, optional
        Flights that were left, kept, or are unsaved.
    history : SettingsHistory, optional
        Settings to undo and redo.
    held : frozenset of str, optional
        Held commands that are running, by name.
    hand : HandControl, optional
        Manual control of the chaser.
    asked : Question or None, optional
        Question that a command waits for.

    Attributes
    ----------
    jobs : Jobs
        Long tasks beside the flight.
    """

    session: FlightSession
    feed: Feed
    options: Options
    table: CommandTable
    feeds: dict[str, Feed] = field(default_factory=dict)
    shown: dict[str, bool] = field(default_factory=dict)
    log: CommandLog = field(default_factory=CommandLog)
    messages: Messages = field(default_factory=Messages)
    opener: ScenarioOpener = field(default_factory=ScenarioOpener)
    draft: ScenarioDraft = field(default_factory=ScenarioDraft)
    jobs: Jobs = field(init=False)
    help: Help = field(default_factory=Help)
    window: WindowRequests = field(default_factory=WindowRequests)
    device_index: int | None = None
    clock_ms: int = 0
    window_hz: float = 0.0
    window_gl: str = ""
    progress: Callable[[], str] = str
    source: str = ""
    recent: list[str] = field(default_factory=list)
    flights: FlightList = field(default_factory=FlightList)
    history: SettingsHistory = field(default_factory=SettingsHistory)
    held: frozenset[str] = frozenset()
    hand: HandControl = field(default_factory=HandControl)
    asked: Question | None = None
    _player: Player | None = None
    _figures: tuple[WorldState, Telemetry] | None = None

    def __post_init__(self) -> None:
        self.remember(self.source)
        self.jobs = Jobs(self.say, self.do)

    def remember(self, source: str) -> None:
        """Put a scenario first in the list of recent ones."""
        if source:
            self.recent = [source, *(name for name in self.recent if name != source)][:KEPT_RECENT]

    def close(self) -> None:
        """End the jobs and close the log."""
        self.log.close()
        self.jobs.close()

    @property
    def losses(self) -> list[str]:
        """The jobs that quitting ends and the unsaved work that it discards, one sentence each."""
        jobs = [f"{job.text}: ends" for job in running_jobs(self.jobs) if job.end != "estimator.run"]
        flights = [
            f"{flight_text(flight)} {self.flights.lost_text(flight)}" for flight in self.flights.unsaved
        ]
        flights += [
            f"{flight_text(flight)} has a dropped future of {duration_text(s)}, in no file: Swap future brings it back"
            for flight, s in self.flights.dropped_s().items()
        ]
        return jobs + flights + [f"the text of {self.draft.name} is not saved"] * self.draft.changed

    @property
    def telemetry(self) -> Telemetry:
        """Figures of the time that is shown, which the newest picture may not have reached."""
        world = self.session.craft.world
        if self._figures is None or self._figures[0] is not world:
            self._figures = world, telemetry_of(world, self.session.scene())
        return self._figures[1]

    @property
    def flown_by(self) -> str:
        """The mode that flies the chaser while nothing is pressed."""
        craft = self.session.craft
        return craft.steering.doing or ("by hand" if craft.mode == "steer" else "scenario's guidance")

    # --- commands

    def do(self, name: str, *arguments: Value, asks: bool = True) -> None:
        """Run a command, as its key, its button or a script does; show a refusal as a message.

        Parameters
        ----------
        name : str
            Name of the command.
        arguments : Value
            Values in the order of the command's declaration.
        asks : bool, optional
            True if a command that drops or leaves a flight that is in no file first asks.
        """
        refusal = self.attempt(name, *arguments, asks=asks)
        level: Level = "caution" if UNWRITABLE.search(refusal) or self._flies(name, arguments) else "note"
        self.say(refusal, level, name)

    def _flies(self, name: str, arguments: Sequence[Value]) -> bool:
        """Return True for a well-formed command that acts on the chaser, whose refusal is a caution of the flight."""
        try:
            self.table[name].checked(arguments)
        except UserError:
            return False
        return acts_on_chaser(name)

    def attempt(self, name: str, *arguments: Value, asks: bool = True) -> str:
        """Run a command as `do` does, and return why it was refused.

        A command that drops or leaves a flight that is in no file first asks, unless ``asks`` is False.

        Returns
        -------
        str
            Sentence of the refusal; empty if the command ran, or if it waits for the answer to a question.
        """
        try:
            command = self.table[name]
            values = command.checked(arguments)
            if asks and self._asks(command, values):
                return ""
            self._note(Line(self.clock_ms, "do", name, values))
            self.options.flight = self.session.craft.choices
            before = deepcopy(self.options)
            values = command.call(self, values)
            self.messages.acknowledge([m for m in self.messages.waiting if self._settles(command, m)])
            if acts_on_chaser(name):
                self.flights.note_own(self.session)
            self.options.flight = self.session.craft.choices
            change = change_text(command, values, self.session, before, self.options)
            self.history.note(name, before, self.options, self.clock_ms, change)
        except (UserError, OSError) as error:
            # the flight continues, whatever happens in a command
            return str(error)
        return ""

    def _settles(self, command: Command, message: Message) -> bool:
        """Return True if a command that was carried out ends a caution: its own, or one of flying."""
        flown = command.group in FLOWN and message.of.partition(".")[0] in FLOWN
        return message.of == command.name or flown

    def _note(self, line: Line) -> None:
        """Add a line to the log; a full disk must not prevent an abort."""
        try:
            self.log.add(line)
        except OSError as error:
            text = f"the log file can no longer be written: {error.strerror}"
            # it stays closed
            self.say(text, "warning", over=lambda: False)

    def _asks(self, command: Command, values: tuple[Value, ...]) -> bool:
        """Ask before a command drops or leaves a flight; return True if the command must wait."""
        lost = self.flights.lost_text(self.session)
        changes = self.history.next_of_flight(command.name)
        question = question_before(self.session, command, values, self.draft.name, lost, changes)
        if question is not None:
            self.asked = question
            self.open_panel("question", shown=True)
        return question is not None

    def answer(self, goes: bool) -> None:  # noqa: FBT001 - of a question
        """Answer the question that is open; a command that a key holds must be pressed again."""
        asked, self.asked = self.asked, None
        if asked is None or not goes:
            return
        if asked.first:
            self.do(asked.first, asks=False)
        if not asked.command.held:
            self.do(asked.command.name, *asked.values, asks=False)

    def do_line(self, line: str) -> None:
        """Run a command given as a line: its name, followed by its arguments."""
        try:
            name, *words = shlex.split(line)
        except ValueError:
            self.say(f"unknown command: {line[:120]}; F1 lists the commands", of=line)
            return
        self.do(name, *words)

    def order(self, order: Order) -> None:
        """Give the flight an order, and show its answer."""
        if (answer := self.session.order(order)) is not None:
            self.say(answer[1], answer[0])

    def press(self, commands: Sequence[Command]) -> None:
        """Run the commands of keys that were pressed, as `steer` does."""
        for command in commands:
            if command.at_once:
                self.steer(command.name)

    def steer(self, name: str, *arguments: Value) -> None:
        """Run the command of a key or gamepad; unarmed, none that flies but Go at a hold point."""
        goes = name == "docking.go" and self.session.waits_for_go
        if self.table[name].flies and not (self.hand.armed or goes):
            self.say(f"{self.table[name].title}: {UNARMED}")
        else:
            self.do(name, *arguments)

    def hold(self, names: frozenset[str]) -> None:
        """Set the commands held from now on by keys and script."""
        names -= {name for name in names - self.held if self._asks(self.table[name], ())}
        # a script has given its answers
        names |= frozenset(self._player.held if self._player else ())
        for name in sorted(names - self.held):
            self._note(Line(self.clock_ms, "hold", name))
            self.table[name].run(self, True)
            self.flights.note_own(self.session)
        for name in sorted(self.held - names):
            self._note(Line(self.clock_ms, "release", name))
            self.table[name].run(self, False)
        self.held = names

    # --- time

    def play(self, script: Script) -> None:
        """Run a script's lines at their times from now on."""
        self._player = Player(script)

    def pass_time(self, wall_ms: int, keys: frozenset[str] = frozenset()) -> None:
        """Advance real time, running a script's commands at their exact milliseconds.

        Time stops while a scenario is being opened, so that replaying the log reproduces the flight, and while a
        question stands, unless a script runs.

        Parameters
        ----------
        wall_ms : int
            Elapsed real time.
        keys : frozenset of str, optional
            Commands whose keys are held.
        """
        if not self.hand.armed:
            if keys & STEERING:
                self.say(UNARMED)
            keys = frozenset()
        self._take_opened()
        if self.opener.is_busy():
            return
        if self.questioned:
            # a key that is let go does not push afterwards, and one that is pressed is no answer
            self.hold(self.held & keys)
            self.stand()
            return
        end = self.clock_ms + min(max(wall_ms, 0), LONGEST_TICK_MS)
        while self._player is not None and (due := self._player.next_ms()) is not None and due <= end:
            self._advance(max(due, self.clock_ms))
            lines = self._player.due(self.clock_ms)
            self.hold(keys)
            for line in lines:
                self.do(line.name, *line.arguments, asks=False)
            if self.opener.is_busy():
                return
        self._advance(end)
        self.hold(keys)
        self.jobs.update(self.session, self.feed.newest, self.clock_ms)

    @property
    def questioned(self) -> bool:
        """True while a question to the operator stands; a script that has lines left gives no answers."""
        stands = self.shown.get("quit") or (self.asked is not None and self.shown.get("question"))
        return bool(stands) and (self._player is None or self._player.next_ms() is None)

    def stand(self) -> None:
        """Update background jobs while the flight waits for its first picture, or for an answer."""
        self._take_opened()
        self.jobs.update(self.session, self.feed.newest, self.clock_ms)

    def _advance(self, t_ms: int) -> None:
        before = self.session.state
        try:
            state = self.session.step(self.hand.command(), (t_ms - self.clock_ms) / 1000)
        except UserError as error:
            # for example an orbit that reaches the ground: the flown part can still be replayed
            session = self.session
            session.clock.paused = True
            self.say(f"the flight is paused: {error}", "warning", over=lambda: not session.clock.paused)
        else:
            pulsed = not state.doing and state.propellant != before.propellant
            pushed = pulsed or self.session.craft.steering.takes_over
            self.hand.flown |= pushed and state.t_s > before.t_s
            for level, text in state.news:
                self.say(text, level)
                self.messages[-1].news = True
        self.flights.note_flown_on(self.session, before.t_s)
        self.messages.end(self.session, probes=t_ms // 1000 != self.clock_ms // 1000)
        self.clock_ms = t_ms

    def _take_opened(self) -> None:
        """Start the flight of a scenario that was opened, if any."""
        try:
            session = self.opener.take()
        except UserError as error:
            self.say(str(error), of="scenario.open")
            if self.opener.scenario is self.draft.flown:
                self.draft.problem = str(error)
            return
        if session is not None:
            self._begin(session, self.opener.source)

    def go_back(self, which: int = 1) -> None:
        """Return to a flight that was left, by default the last one, paused; a second call returns to the present one.

        Raises
        ------
        UserError
            If there are not so many.
        """
        session, source = self.flights.left(which)
        session.clock.rest()
        self._begin(session, source)

    def _begin(self, session: FlightSession, source: str) -> None:
        """Make ``session`` the current flight, and keep the present one for `go_back`."""
        recorder = self.session.look_back.recorder
        if recorder is not None:
            self.session.look_back.recorder = None
            self.say("the recording ends with the scenario that was flown", "caution", "scenario.open")
        self.flights.leave(self.session, self.source, session)
        self.session, self.source = session, source
        self.remember(self.source)
        self.hand.armed = False
        self.hand.centre_sticks()
        # data of the previous flight must not appear as this one's
        self.jobs.estimates.forget()
        self.messages.acknowledge(self.messages.waiting)
        settings = self.options.settings
        settings.bands, settings.environment = session.plan.bands, session.scene().environment
        # the operator's changes applied to the sensor and lights of the previous scenario
        settings.sensor_changes, settings.lights, settings.exposure_stops = {}, None, 0.0
        self.history = SettingsHistory()
        name = session.plan.scenario.title or session.plan.scenario.name
        replay = "REPLAY, paused: Space plays it, the slider seeks" if session.look_back.active else ""
        self.say(replay or f"now: {name}; File > Previous flight returns to the last one")

    # --- messages

    def save(self, path: Path, write: Callable[[Path], object], command: str) -> None:
        """Write the result of a command, whose folder is made; a failure is a caution, and the flight continues."""
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write(path)
            self.say(f"saved {path}", of=command)
        except (UserError, OSError) as error:
            self.say(f"not saved: {error}", "caution", command)

    def say(
        self, text: str, level: Level = "note", of: str = "", over: Callable[[], bool] | None = None
    ) -> None:
        """Show a message; an immediate repetition, and an empty text, are dropped.

        Parameters
        ----------
        text : str
            Message.
        level : str, optional
            A caution or warning stays until it is seen, or until its cause has ended.
        of : str, optional
            Command that was refused or failed, whose caution ends when it is carried out; or that gave a result.
        over : callable, optional
            Function that returns True once the cause of a caution has ended, or a note is no longer true; by default
            `FlightSession.is_over`.
        """
        message = Message(self.session.t_s, level, text, of=of, over=over, said_ms=self.clock_ms)
        self.messages.add(message)

    @property
    def preparing(self) -> str:
        """Sentence on what a view is waiting for."""
        return f"preparing: {self.progress() or 'the picture'}"

    def open_panel(self, name: str, *, shown: bool | None = None) -> None:
        """Open or close a panel or view (by default, toggle), and raise it."""
        self.shown[name] = not self.shown.get(name, False) if shown is None else shown
        if self.shown[name]:
            self.window.front = name
