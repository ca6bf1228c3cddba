"""The console's main loop: turns input into commands, advances the flight, requests pictures and draws the window."""

from __future__ import annotations

import logging
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flyaround.gui import style
from flyaround.gui.command_table import CommandTable
from flyaround.gui.commands.all import COMMANDS
from flyaround.gui.commands.people import script_header
from flyaround.gui.console import LONGEST_TICK_MS, Console
from flyaround.gui.gamepad import Gamepad
from flyaround.gui.jobs.all import running_jobs
from flyaround.gui.jobs.program import FOLDER
from flyaround.gui.layout import Layout, layout_file, panel_commands, read_layout
from flyaround.gui.picture.feed import Feed, Picture
from flyaround.gui.picture.further import CAMERA_SHARE, LaterFrames, further_feeds
from flyaround.gui.picture.turns import Turns
from flyaround.gui.picture.view_settings import Options, ViewSettings
from flyaround.gui.script import Script
from flyaround.gui.surface import Surface, import_parts
from flyaround.gui.window import Window
from flyaround.simulator.dataset.formats.native import encode_png
from flyaround.simulator.dataset.single_frames import save_picture
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import Frame
from flyaround.simulator.loop import open_frames
from flyaround.simulator.piloting.recorder import REPLAY_NAME, FlightRecorder
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.runtime.files import empty_folder, new_path, write_atomic
from flyaround.simulator.runtime.progress import ProgressLine
from flyaround.simulator.scenario.load import load_scenario

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from flyaround.simulator.loop import FrameProducer
    from flyaround.simulator.runtime.arrays import ByteArray
    from flyaround.simulator.scene.state import SceneState

log = logging.getLogger(__name__)

WINDOW_HZ, SOFTWARE_HZ = 60.0, 33.0
"""Refresh rate of the window; lower with a software driver, where the same cores render the pictures."""
STILL_HZ = 10.0
"""Refresh rate without new pictures or input."""
SHARE = 0.9
"""Largest share of the main loop's time for drawing the window."""
SLICE_S = 1 / 60
"""Longest period between checks of input, time and pictures."""
URGENT, URGENT_ARMED = ("delete",), ("delete", "x")
"""Keys of abort and stop, which are handled before other queued keys if the window is slow."""
FLIGHT_GROUPS = frozenset({"steer", "guidance", "burn", "docking", "time", "timeline"})
FLYING_MS = 100.0
"""Processing time of the flight per frame [ms]; beyond it the operator's time runs slower than real time."""
GIVES_WAY = 5
"""Niceness of the render process, so that keys and the window stay responsive."""
WRITING = frozenset({"capture.stop", "film.stop", "hil.stop"})
"""Commands that end the jobs whose files are finished after the window has closed."""
ANSWER_WITHIN_S = 20.0
"""Time without processor use, while a picture is due, after which the render process is restarted."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """Arguments of `flyaround sim`.

    Parameters
    ----------
    scenario : str
        Built-in name or TOML file.
    choose : bool, optional
        True to start with the scenario chooser.
    size : tuple of int, optional
        Size of the window.
    off_screen : bool, optional
        True to draw it into a texture, without a display.
    seed : int, optional
        Replaces the scenario's.
    device_index : int, optional
        EGL device of the render process.
    seconds : float, optional
        Time after the first picture at which the console closes.
    screenshot : Path, optional
        File for a picture of the whole window at the end.
    overlays : tuple of str, optional
        Names of `flyaround.gui.picture.view_settings.Overlays` to switch on.
    record : Path, optional
        Folder for the flown flight and the scenario that replays it.
    script : Path, optional
        Commands with their times.
    log : Path, optional
        File to which executed commands are written, as a script.
    """

    scenario: str
    choose: bool = False
    size: tuple[int, int] = (1280, 800)
    off_screen: bool = False
    seed: int | None = None
    device_index: int | None = None
    seconds: float | None = None
    screenshot: Path | None = None
    overlays: tuple[str, ...] = ()
    record: Path | None = None
    script: Path | None = None
    log: Path | None = None


def command_table() -> CommandTable:
    """Return every command of the console.

    Returns
    -------
    CommandTable
        A new table: the operator's commands, then those of panels and layouts.
    """
    return CommandTable((*COMMANDS, *panel_commands()))


def run(request: Request) -> dict[str, Any]:
    """Open the console, and return its last state when it is closed.

    Returns
    -------
    dict of str to object
        Last state of the console, serialisable as JSON; under ``replay`` the path of the recording, if there is one.

    Raises
    ------
    UserError
        If there is no display, the optional parts are missing, or the scenario or the script is wrong.
    """
    import_parts(off_screen=request.off_screen)
    table = command_table()
    script = None if request.script is None else Script.read(request.script, table)
    if request.record is not None:
        # check the folder now: an error after the flight would lose the recording
        empty_folder(request.record, option="--record")
    recorder = FlightRecorder()
    session = FlightSession.of(
        load_scenario(request.scenario),
        seed=request.seed,
        recorder=None if request.record is None else recorder,
    )
    if request.record is None:
        # what is recorded must be flown
        session.show_recording()
        # nobody presses Play if it ends by itself, or is played
        unattended = {request.seconds, request.script, request.screenshot} != {None}
        session.clock.paused = session.look_back.active and not unattended
    options = options_of(session, request.overlays)
    progress = ProgressLine()

    def frames(first: SceneState) -> AbstractContextManager[FrameProducer[Frame]]:
        return open_frames(
            Frame.without_radiance,
            processes=1,
            device_index=request.device_index,
            first=first,
            # one being drawn and one queued: more would only add delay
            ahead=2,
            restarts=True,
            answer_within_s=ANSWER_WITHIN_S,
            niceness=GIVES_WAY,
            progress=progress,
        )

    with (
        _surface(request, f"Flyaround - {session.plan.scenario_name}") as window,
        frames(session.plan.scene(0)) as producer,
        ExitStack() as later,
    ):
        if request.record is not None:
            recorder.keep_in(request.record, session.plan.scenario)
        turns = Turns(producer)
        orbit_frames = LaterFrames(lambda scene: later.enter_context(frames(scene)))
        console = Console(
            session,
            Feed(turns.channel(CAMERA_SHARE)),
            options,
            table,
            source=request.scenario,
            feeds=further_feeds(turns, orbit_frames, options),
            device_index=request.device_index,
            window_gl=window.gl_renderer,
            progress=progress.read,
        )
        if script is not None:
            console.play(script)
        try:
            if request.log is not None:
                console.log.write_to(request.log, script_header(console))
            state = ConsoleLoop(window, console, request).run()
        finally:
            window.hide()
            for files in unfinished_files(console):
                sys.stderr.write(f"flyaround: finishing the files of: {files}\n")
            # keep the recording also if the flight ends with an error
            with ThreadPoolExecutor() as ends:
                recorded = ends.submit(recorder.close)
                # each waits for processes of its own
                list(ends.map(lambda end: end(), (producer.close, later.close, console.close)))
            replay = recorded.result()
    if replay is not None:
        state["replay"] = str(replay)
    return state


def unfinished_files(console: Console) -> list[str]:
    """Return what writes files that are finished after the window has closed: jobs, and the recording of the flight.

    Returns
    -------
    list of str
        A phrase on each.
    """
    recorder = console.session.look_back.recorder
    jobs = [job.text for job in running_jobs(console.jobs) if job.end in WRITING]
    return [*jobs, *["the recording"] * (recorder is not None and recorder.long_enough)]


def _surface(request: Request, title: str) -> Surface:
    if not request.off_screen:
        return Window(title, request.size)
    # PyOpenGL selects its platform at import: import only the surface in use
    from flyaround.gui.off_screen import OffScreen  # noqa: PLC0415

    return OffScreen(request.size)


def options_of(session: FlightSession, overlays: tuple[str, ...] = ()) -> Options:
    """Return the initial settings of a flight's view.

    Returns
    -------
    Options
        Settings of the scenario's bands and environment, with the orbit view at the present range and the named
        overlays on.

    Raises
    ------
    UserError
        If there is no such overlay.
    """
    options = Options(ViewSettings(bands=session.plan.bands, environment=session.scene().environment))
    options.orbit.reset(session.craft.world.range_m)
    for name in overlays:
        if not hasattr(options.overlays, name):
            names = ", ".join(vars(options.overlays))
            raise UserError(f"unknown overlay '{name}' in --overlays; choose from {names}")
        setattr(options.overlays, name, True)
    return options


class ConsoleLoop:
    """The main loop: wait for input, advance time, request pictures, draw the window."""

    def __init__(self, window: Surface, console: Console, request: Request) -> None:
        self._window = window
        self._console = console
        self._request = request
        self._layout_file = layout_file()
        layout = read_layout(self._layout_file)
        window.font_scale = console.window.font_scale = layout.font_scale
        style.apply_style(window.imgui, window.scale)
        self._layout = Layout(window, layout)
        console.help.descriptions = self._layout.descriptions()
        console.recent += [name for name in layout.recent if name not in console.recent]
        console.flights.files += layout.flights
        if request.record is not None:
            console.flights.files.append(str((request.record / REPLAY_NAME).absolute()))
        console.shown.update(self._layout.first_shown())
        if request.choose:
            console.open_panel("scenarios", shown=True)
        # nobody is there if it ends by itself, or is played
        if not self._layout.tour_seen and {request.seconds, request.script, request.screenshot} == {None}:
            console.open_panel("tour", shown=True)
        self._keys = sorted(console.table.keys())
        self._held: list[str] = []
        self._pressed: list[str] = []
        """Keys pressed in this frame: each counts until time has advanced, however short it was held."""
        self._gamepad = Gamepad()
        self._window_ms, self._longest_ms = 0.0, LONGEST_TICK_MS
        self._drawn_s: list[float] = []

    def run(self) -> dict[str, Any]:
        """Run until the window is closed or the time is up; return the last state."""
        window, console = self._window, self._console
        last_ms = 0
        drawn_s = window.seconds
        first_picture: float | None = None
        needs_drawing = True
        hz = SOFTWARE_HZ if window.software else WINDOW_HZ
        while self._stays_open():
            least_s = max(1 / hz, min(1e-3 * self._window_ms / SHARE, 1 / STILL_HZ))
            # while time runs, maps and figures change without new pictures
            needs_drawing |= not console.session.clock.paused
            due = drawn_s + (least_s if needs_drawing else 1 / STILL_HZ)
            needs_drawing |= window.wait(min(max(due - window.seconds, 0.0), SLICE_S))
            now = window.seconds
            now_ms = round(now * 1000)
            self._pass_time(now_ms - last_ms)
            last_ms = now_ms
            for name, *arguments in self._gamepad.commands(window.gamepad()):
                console.steer(name, *arguments)
            needs_drawing |= self._update_feeds()
            self._report_failures()
            if now - drawn_s >= (least_s if needs_drawing else 1 / STILL_HZ):
                self._draw()
                self._account(now)
                drawn_s, needs_drawing = now, False
            if first_picture is None and console.feed.newest is not None:
                first_picture = now
                log.info("first picture after %.1f s", now)
            limit = self._request.seconds
            if limit is not None and first_picture is not None and now - first_picture > limit:
                break
        if self._request.screenshot is not None:
            write_atomic(self._request.screenshot, encode_png(self._look_of_window()))
        self._layout.keep(console, self._layout_file)
        return self._last_state()

    def _stays_open(self) -> bool:
        """Return False at the end; the window's close button asks like `window.quit`."""
        window, console = self._window, self._console
        if not window.open:
            console.do("window.quit")
            if not console.window.close:
                window.stay_open()
        return window.open and not console.window.close

    def _pass_time(self, wall_ms: int) -> None:
        """Advance the flight by elapsed real time, once there is a picture; a released key stops acting at once."""
        console, down = self._console, self._window.keys.still_held(self._held)
        pressed, self._held, self._pressed = self._pressed, down, []
        if console.feed.newest is None:
            console.stand()
        else:
            tick_ms, began_s = min(wall_ms, self._longest_ms), self._window.seconds
            console.pass_time(tick_ms, console.table.held([*down, *pressed]))
            spent_ms = 1e3 * (self._window.seconds - began_s)
            # costly steps at a high rate: less time passes in a frame, so that keys and abort act soon
            if tick_ms:
                self._longest_ms = max(
                    int(min(tick_ms * FLYING_MS / max(spent_ms, 1e-3), LONGEST_TICK_MS)), 1
                )

    def _update_feeds(self) -> bool:
        """Take finished pictures and request new ones; return True if one arrived."""
        console = self._console
        session, settings = console.session, console.options.settings
        has_new = console.feed.update(session, settings, timed=console.options.overlays.times)
        for feed in console.feeds.values():
            if feed.looked_at or feed.waiting:
                has_new |= feed.update(session, settings)
        return has_new

    def _draw(self) -> None:
        """Draw one frame of the window and run the commands of its keys."""
        window, console = self._window, self._console
        requests = console.window
        for path in window.take_dropped():
            console.do("file.open", path)
        window.font_scale = requests.font_scale
        self._layout.before_frame(console, window.size)
        # the requested screenshot is this frame
        screenshot, requests.screenshot = requests.screenshot, None
        window.capture = screenshot is not None
        with window.frame():
            if window.keys.typing and console.hand.armed:
                console.do("steer.arm", False)
                console.say("hand control is off, because letters go into a text field; HAND: OFF arms it")
            hit = console.table.pressed(window.keys.hit(self._keys), ctrl=window.keys.ctrl)
            # ignore flight commands before the first picture: the operator would fly blind
            console.press([c for c in hit if console.feed.newest is not None or c.group not in FLIGHT_GROUPS])
            self._held, self._pressed = window.keys.held(self._keys), window.keys.hit(self._keys)
            window.keys.set_urgent(URGENT_ARMED if console.hand.armed else URGENT)
            self._save_finished()
            self._layout.draw(console)
        window.capture = False
        if screenshot is not None and (look := window.captured) is not None:
            console.save(screenshot, lambda to: write_atomic(to, encode_png(look)), "window.screenshot")
        if requests.full_screen:
            requests.full_screen = False
            window.toggle_full_screen()

    def _account(self, began_s: float) -> None:
        now = self._window.seconds
        self._window_ms = 0.9 * self._window_ms + 0.1 * (now - began_s) * 1e3
        self._drawn_s = [t for t in self._drawn_s if now - t < 2.0] + [now]
        span = self._drawn_s[-1] - self._drawn_s[0]
        self._console.window_hz = (len(self._drawn_s) - 1) / span if span > 0 else 0.0

    def _look_of_window(self) -> ByteArray:
        """Draw the window once more and return its pixels."""
        self._window.capture = True
        with self._window.frame():
            self._layout.draw(self._console)
        if self._window.captured is None:
            raise RuntimeError("the window was drawn but not captured")
        return self._window.captured

    def _save_finished(self) -> None:
        console = self._console
        while console.feed.saved:
            frame = console.feed.saved.pop(0).frame
            name = console.session.plan.scenario.name
            path = new_path(FOLDER, f"{name}-{round(frame.scene.t_s * 1000):09d}ms", ".png")
            console.save(path, partial(save_picture, frame), "picture.save")

    def _report_failures(self) -> None:
        """Report failures of pictures, each once; the flight continues."""
        recorder = self._console.session.look_back.recorder
        for feed in (self._console.feed, *self._console.feeds.values()):
            if (trouble := feed.take_trouble()) is not None:
                self._console.say(trouble, "warning", over=partial(_has_newer, feed, feed.newest))
        if recorder is not None and (trouble := recorder.take_trouble()) is not None:
            self._console.say(trouble, "warning", over=lambda: recorder.trouble is None)

    def _last_state(self) -> dict[str, Any]:
        console = self._console
        session, feed = console.session, console.feed
        scene, contact = session.scene(), session.craft.docking.contact
        return {
            "scenario": session.plan.scenario.name,
            "mode": session.craft.mode,
            "tracking": session.craft.tracking,
            "paused": session.clock.paused,
            "rate": session.clock.rate,
            **console.telemetry.document(),
            "q_camera_from_target_wxyz": scene.q_camera_from_target_wxyz,
            "t_camera_from_target_m": scene.t_camera_from_target_m,
            "q_camera_from_eci_wxyz": scene.q_camera_from_eci_wxyz,
            "delta_v_m_s": session.craft.steering.propellant.delta_v_m_s,
            "propellant_kg": session.craft.steering.propellant.used_kg,
            "docking": contact and contact.document(),
            "operator_s": console.clock_ms / 1000,
            "commands": len(console.log.lines),
            "pictures": feed.finished,
            "drawing_restarts": feed.restarts,
            "pictures_per_s": round(feed.frames_s, 2),
            "views": {name: f.finished for name, f in console.feeds.items() if f.finished},
            "pass_ms": {name: round(ms, 2) for name, ms in feed.pass_ms.items()},
            "picture_ms": round(feed.frame_ms, 1),
            "window_ms": round(self._window_ms, 1),
            "window_per_s": round(console.window_hz, 1),
            "window_gl": console.window_gl,
        }


def _has_newer(feed: Feed, picture: Picture | None) -> bool:
    return feed.newest is not picture
