"""The console's main loop: keys to session, session to render process, newest picture to the window."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2

from gui import style
from gui.feed import Feed, FramesOnRequest
from gui.keys import Action
from gui.panels import SidePanel, draw_help
from gui.recorder import FlightRecorder
from gui.session import Session
from gui.telemetry import telemetry_of
from gui.view_settings import Options, ViewSettings
from gui.viewport import Viewport
from gui.window import Window, import_parts
from simulator.dataset.single_frames import save_picture
from simulator.errors import UserError
from simulator.frame import Frame
from simulator.loop import open_frames
from simulator.runtime.files import empty_folder, write_atomic
from simulator.scenario.load import load_scenario

if TYPE_CHECKING:
    from collections.abc import Callable

    from simulator.runtime.arrays import ByteArray

log = logging.getLogger(__name__)

SAVE_FOLDER = Path("out") / "console"
WINDOW_HZ = 30.0
"""The window's own rate: fast enough for keys, and software GL keeps its cores for the picture."""
STILL_HZ = 10.0
"""When neither a picture nor input has come."""
SLICE_S = 1 / 60


@dataclass(frozen=True, kw_only=True)
class Request:
    """What `flyaround sim` was asked for.

    Parameters
    ----------
    scenario : built-in name or TOML file.
    size : of the window. seed : instead of the scenario's. device_index : EGL device of the render process.
    seconds : close by itself after this long, counted from the first picture.
    screenshot : picture of the whole window at the end.
    overlays : names of `gui.view_settings.Overlays` to switch on.
    record : folder for the flight as it was flown and the scenario that replays it.
    """

    scenario: str
    size: tuple[int, int] = (1280, 800)
    seed: int | None = None
    device_index: int | None = None
    seconds: float | None = None
    screenshot: Path | None = None
    overlays: tuple[str, ...] = ()
    record: Path | None = None


def run(request: Request) -> dict[str, Any]:
    """Open the console, and return its last state when the operator closes it.

    Raises
    ------
    UserError
        If there is no display, the optional parts are missing, or the scenario is wrong.
    """
    import_parts()
    _check_screenshot(request.screenshot)
    if request.record is not None:
        # said now, and not after the flight
        empty_folder(request.record, option="--record")
    recorder = FlightRecorder()
    session = Session.of(
        load_scenario(request.scenario),
        seed=request.seed,
        recorder=None if request.record is None else recorder,
    )
    with (
        Window(f"Flyaround - {session.plan.scenario_name}", request.size) as window,
        open_frames(
            Frame.without_radiance,
            processes=1,
            device_index=request.device_index,
            first=session.plan.scene(0),
            # one being drawn and one waiting: more would only make the picture older
            ahead=2,
            restarts=True,
        ) as producer,
    ):
        if request.record is not None:
            recorder.keep_in(request.record, session.plan.scenario)
        try:
            state = Console(window, session, producer, request).run()
        finally:
            # also when the flight ends otherwise than it should
            replay = recorder.close()
    if replay is not None:
        state["replay"] = str(replay)
    return state


class Console:
    """The loop over one window and one session."""

    def __init__(self, window: Window, session: Session, producer: FramesOnRequest, request: Request) -> None:
        self._window = window
        self._session = session
        self._request = request
        self._feed = Feed(producer)
        scenario = session.plan.scenario
        settings = ViewSettings(bands=session.plan.bands, environment=session.scene().environment)
        self._options = Options(settings)
        for name in request.overlays:
            if not hasattr(self._options.overlays, name):
                known = ", ".join(vars(self._options.overlays))
                raise UserError(f"unknown overlay '{name}' in --overlays; choose from {known}")
            setattr(self._options.overlays, name, True)
        style.apply_style(window.imgui, window.scale)
        self._panel = SidePanel(window, session)
        self._view = Viewport(window, session.plan.target)
        self._scenario_name = scenario.name
        self._window_ms = 0.0

    def run(self) -> dict[str, Any]:
        """Until the window is closed or the time is up."""
        window, session, feed = self._window, self._session, self._feed
        last = drawn = window.seconds
        first_picture: float | None = None
        changed = True
        held: frozenset[Action] = frozenset()
        while window.open:
            changed |= window.wait(SLICE_S)
            now = window.seconds
            session.advance(now - last if first_picture is not None else 0.0, held)
            last = now
            changed |= feed.update(session, self._options.settings, timed=self._options.overlays.times)
            self._tell_troubles()
            # where software draws the window too, it takes half of the time at most
            least_s = max(1 / WINDOW_HZ, min(2e-3 * self._window_ms, 1 / STILL_HZ))
            if now - drawn >= (least_s if changed else 1 / STILL_HZ):
                with window.frame():
                    self._keys()
                    held = window.held()
                    self._save_finished()
                    self._lay_out()
                self._window_ms = 0.9 * self._window_ms + 0.1 * (window.seconds - now) * 1e3
                drawn, changed = now, False
            if first_picture is None and feed.newest is not None:
                first_picture = now
                log.info("first picture after %.1f s", now)
            limit = self._request.seconds
            if limit is not None and first_picture is not None and now - first_picture > limit:
                window.close()
        if self._request.screenshot is not None:
            write_atomic(self._request.screenshot, _png(self._look_of_window()))
        return self._last_state()

    def _look_of_window(self) -> ByteArray:
        """The window drawn once more, as pixels."""
        self._window.capture = True
        with self._window.frame():
            self._lay_out()
        if self._window.captured is None:
            raise RuntimeError("the window was drawn but not captured")
        return self._window.captured

    def _keys(self) -> None:
        session, options, on = self._session, self._options, self._options.overlays
        single: dict[Action, Callable[[], object]] = {
            Action.PAUSE: session.toggle_pause,
            Action.STEP: session.step_once,
            Action.FASTER: session.faster,
            Action.SLOWER: session.slower,
            Action.RESTART: session.restart,
            Action.STOP: session.stop,
            Action.TRACK: session.toggle_tracking,
            Action.CENTRE: session.centre,
            Action.HOLD_STEER: session.toggle_steering,
            Action.RESET: session.reset_chaser,
            Action.SCREENSHOT: self._feed.ask_to_save,
            Action.FULL_SCREEN: self._window.toggle_full_screen,
            Action.HELP: lambda: _flip(options, "help"),
            Action.CLOSE_HELP: lambda: setattr(options, "help", False),
            Action.PANEL: lambda: _flip(options, "panel"),
            Action.HUD: lambda: _flip(on, "hud"),
            Action.TIMES: lambda: _flip(on, "times"),
            Action.CROSSHAIR: lambda: _flip(on, "crosshair"),
            Action.KEYPOINTS: lambda: _flip(on, "keypoints"),
            Action.BOX: lambda: _flip(on, "box"),
            Action.AXES: lambda: _flip(on, "axes"),
            Action.WIREFRAME: lambda: _flip(on, "wireframe"),
        }
        for action in self._window.pressed():
            single[action]()

    def _lay_out(self) -> None:
        width, height = self._window.imgui.get_io().display_size
        panel = self._panel.width if self._options.panel and width > 2 * self._panel.width else 0.0
        self._view.draw((0.0, 0.0, width - panel, height), self._session, self._feed, self._options)
        if panel:
            self._panel.draw((width - panel, 0.0, panel, height), self._session, self._feed, self._options)
        draw_help(self._window, self._options)

    def _save_finished(self) -> None:
        while self._feed.saved:
            frame = self._feed.saved.pop(0).frame
            path = SAVE_FOLDER / f"{self._scenario_name}-{round(frame.scene.t_s * 1000):09d}ms.png"
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                save_picture(frame, path)
                self._panel.message = f"saved {path} and .json"
            except (UserError, OSError) as error:
                # the flight goes on: a full disk must not end it
                self._panel.message = f"not saved: {error}"
            log.info("%s", self._panel.message)

    def _tell_troubles(self) -> None:
        """What goes wrong meanwhile, once: the flight goes on."""
        recorder = self._session.recorder
        for trouble in (self._feed.take_trouble(), None if recorder is None else recorder.take_trouble()):
            if trouble is not None:
                self._panel.message = trouble
                log.warning("%s", trouble)

    def _last_state(self) -> dict[str, Any]:
        session, feed = self._session, self._feed
        world, scene = session.moment.world, session.scene()
        return {
            "scenario": self._scenario_name,
            "mode": session.mode,
            "tracking": session.tracking,
            "paused": session.paused,
            "rate": session.rate,
            **telemetry_of(world, scene).document(),
            "q_camera_from_target_wxyz": scene.q_camera_from_target_wxyz,
            "t_camera_from_target_m": scene.t_camera_from_target_m,
            "q_camera_from_eci_wxyz": scene.q_camera_from_eci_wxyz,
            "pictures": feed.finished,
            "drawing_restarts": feed.restarts,
            "pictures_per_s": round(feed.frames_s, 2),
            "pass_ms": {name: round(ms, 2) for name, ms in feed.pass_ms.items()},
            "picture_ms": round(feed.frame_ms, 1),
            "window_ms": round(self._window_ms, 1),
            "window_gl": self._window.gl_renderer,
        }


def _flip(what: object, name: str) -> None:
    setattr(what, name, not getattr(what, name))


def _check_screenshot(path: Path | None) -> None:
    if path is None:
        return
    if path.suffix != ".png":
        raise UserError(
            f"cannot write '{path.suffix}' pictures ({path}); end the name of --screenshot in .png"
        )
    if not path.parent.is_dir():
        raise UserError(
            f"folder {path.parent} does not exist; make it, or name another place with --screenshot"
        )


def _png(image: ByteArray) -> bytes:
    ok, data = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_PNG_COMPRESSION, 9])
    if not ok:
        raise RuntimeError("the window's picture could not be encoded")
    return data.tobytes()
