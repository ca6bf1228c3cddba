"""A view's live feed, the sink behind it: asks for frames of the newest moment, never for more than can be drawn."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from statistics import median
from typing import TYPE_CHECKING, Protocol

from flyaround.gui.picture.view_settings import apply_view_settings
from flyaround.simulator.errors import UserError
from flyaround.simulator.loop import FrameRequest
from flyaround.simulator.piloting.telemetry import Telemetry, telemetry_of
from flyaround.simulator.runtime.worker_pool import JobsLostError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from flyaround.gui.picture.view_settings import ViewSettings
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.labels.request import LabelRequest
    from flyaround.simulator.piloting.session import FlightSession, FlightState
    from flyaround.simulator.scene.state import Quality, SceneState
    from flyaround.simulator.targets.model import Target

    SceneOf = Callable[[FlightSession, ViewSettings, int, Quality | None], SceneState]

TIMED_PICTURES = 5
"""The pass times that are shown are medians of so many pictures."""
LIVE_MS = 90.0
"""What a picture may cost while things move."""
DIVISORS = (1, 2, 3, 4)
ENOUGH = 3
"""Pictures of one size before it is judged."""
MEMORY_S = 15.0
"""How long a size that was too slow is not tried again."""
FAILED = "the console's render process failed ({}); run flyaround -vv sim for more, or flyaround doctor"
REST_S = 2.0
"""Before a picture that failed is asked for again."""
STALE_S, LEAST_SPAN_S = 2.0, 0.5
"""A picture that is replaced no sooner is shown as an old one."""
SEEN_S = 0.5
"""A view that has not been drawn for so long is not looked at, and gets no pictures."""


class PictureFailedError(Exception):
    """The picture that was asked for the longest ago could not be made; says why in one sentence."""


class FramesOnRequest(Protocol):
    """A frame producer as the feed uses it. Its methods may raise `JobsLostError` and `PictureFailedError`."""

    def submit(self, request: FrameRequest) -> bool:
        """Ask for a frame; False when enough are under way."""

    def finished(self) -> Iterable[Frame]:
        """Return the frames finished since the last call, in the order they were asked for."""


@dataclass(frozen=True, eq=False)
class Picture:
    """One finished frame and the figures of its moment."""

    frame: Frame
    state: FlightState
    target: Target
    telemetry: Telemetry
    divisor: int


def chaser_scene(
    session: FlightSession, settings: ViewSettings, divisor: int, quality: Quality | None
) -> SceneState:
    """Return the scene of the chaser's camera now, with the operator's settings."""
    return apply_view_settings(session.scene(), settings, divisor=divisor, quality=quality)


@dataclass(frozen=True, kw_only=True)
class PictureKind:
    """The kind of pictures that a feed requests.

    Parameters
    ----------
    scene : of the moment: given session, settings, pixels of the camera per pixel drawn, quality (None: its own).
    labels : label layers that come with every picture. every_s : the least time between two pictures.
    title : of its view, for people. needed : whether there is no console without it.
    """

    scene: SceneOf = chaser_scene
    labels: LabelRequest | None = None
    every_s: float = 0.0
    title: str = "chaser's camera"
    needed: bool = True


CHASER_CAMERA = PictureKind()


@dataclass
class _Request:
    scene: SceneState
    state: FlightState
    target: Target
    divisor: int
    saved: bool
    timed: bool
    discarded: bool = False


class Feed:
    """Keeps one picture in the making and, when it is about due, one more waiting.

    Parameters
    ----------
    producer : draws in another process; the UI owns the window's context alone. Several feeds share one by `Turns`.
    clock : seconds, monotonic. kind : what it asks for.
    """

    def __init__(
        self,
        producer: FramesOnRequest,
        clock: Callable[[], float] = time.perf_counter,
        kind: PictureKind = CHASER_CAMERA,
    ) -> None:
        self._producer = producer
        self._clock = clock
        self._kind = kind
        self._asked_s = self._seen_s = -1e9
        self._waiting: list[_Request] = []
        self._detail = AdaptiveResolution()
        self._last: SceneState | None = None
        self._session: FlightSession | None = None
        self._save_wanted = False
        self._due_s = self._waits_since_s = 0.0
        self.newest: Picture | None = None
        self.saved: list[Picture] = []
        self.finished = 0
        self.frame_ms = 0.0
        self.restarts = 0
        self._trouble: str | None = None
        self._told_failure = ""
        self._rests_until_s = -1e9
        self._ends_s: list[float] = []
        self._costs: list[tuple[Camera, float]] = []
        self._passes: list[tuple[Camera, dict[str, float]]] = []

    def ask_to_save(self) -> None:
        """Draw the present moment whole, with labels; it comes out in `saved`."""
        self._save_wanted = True

    @property
    def saving(self) -> bool:
        """True while a picture to be saved is under way."""
        return self._save_wanted or any(r.saved for r in self._waiting)

    def look(self) -> None:
        """Note that its view is on the screen; without it `looked_at` ends."""
        self._seen_s = self._clock()

    @property
    def waiting(self) -> bool:
        """True while a picture is under way."""
        return bool(self._waiting)

    @property
    def looked_at(self) -> bool:
        """True while its view is on the screen."""
        return self._clock() - self._seen_s < SEEN_S

    @property
    def pass_ms(self) -> dict[str, float]:
        """Time of each pass of the picture [ms], medians of the last few; empty until one was asked for timed."""
        if not self._passes:
            return {}
        return {name: median(p.get(name, 0.0) for _, p in self._passes) for name in self._passes[-1][1]}

    def update(self, session: FlightSession, settings: ViewSettings, *, timed: bool = False) -> bool:
        """Take what is finished, ask for what is new; whether there is a new picture.

        Parameters
        ----------
        timed : have each pass of the pictures timed; they take a little longer.

        Raises
        ------
        UserError
            If what draws failed and cannot be started again, or the first picture of a view that is needed failed.
        """
        before = self.finished
        if session is not self._session:
            self._begin(session)
        try:
            self._collect()
            self._ask(session, settings, timed=timed)
        except JobsLostError as error:
            self._ask_again(error)
        except PictureFailedError as error:
            if self._kind.needed and not self.finished:
                raise UserError(FAILED.format(error)) from error
            self._rest(error)
        except RuntimeError as error:
            raise UserError(FAILED.format(last_line(error))) from error
        return self.finished > before

    def _begin(self, session: FlightSession) -> None:
        """Show nothing of the flight before: what is under way for it is discarded when it comes."""
        self._save_wanted &= self._session is None
        self._session, self.newest, self._last = session, None, None
        self._waiting = [replace(r, discarded=True) for r in self._waiting]
        self._asked_s, self._ends_s = -1e9, []

    @property
    def late_s(self) -> float:
        """Time since the last picture came [s], while the next is under way for too long; else 0."""
        late_s = self._clock() - self._waits_since_s if self._waiting else 0.0
        return late_s if late_s > STALE_S else 0.0

    @property
    def frames_s(self) -> float:
        """Pictures a second."""
        if len(self._ends_s) < 2 or self.late_s:
            return 0.0
        # two that come together are no rate yet
        return (len(self._ends_s) - 1) / max(self._ends_s[-1] - self._ends_s[0], LEAST_SPAN_S)

    def take_trouble(self) -> str | None:
        """Why pictures were lost or failed since the last call, if some were."""
        trouble, self._trouble = self._trouble, None
        return trouble

    def _ask_again(self, error: JobsLostError) -> None:
        """Forget what will not come; a picture that was to be saved is asked for again."""
        self.restarts += 1
        if self._kind.needed:
            # the others have lost theirs for the same reason
            self._trouble = str(error)
        self._save_wanted = self.saving
        self._waiting, self._last = [], None

    def _rest(self, error: PictureFailedError, then: str = "it is tried again") -> None:
        """Tell a failure, the same one once, and leave its reason some time to go away."""
        self._rests_until_s = self._clock() + REST_S
        self._last = None
        told = f"no picture of the {self._kind.title}: {error}; {then}"
        if told != self._told_failure:
            self._told_failure = self._trouble = told

    def _ask(self, session: FlightSession, settings: ViewSettings, *, timed: bool) -> None:
        if len(self._waiting) >= 2 or (self._waiting and self._clock() < self._due_s):
            return
        if self._clock() < self._rests_until_s:
            return
        if self._save_wanted:
            scene = _made(lambda: apply_view_settings(session.scene(), settings))
            if self._submit(_Request(scene, session.state, session.plan.target, 1, saved=True, timed=False)):
                self._save_wanted = False
            return
        if self._clock() - self._asked_s < self._kind.every_s:
            return
        divisor = self.divisor(settings, paused=session.clock.paused)
        quality: Quality | None = None if session.clock.paused else "draft"
        scene = _made(lambda: self._kind.scene(session, settings, divisor, quality))
        # when nothing moves the picture that is there is the picture, unless its passes are to be timed
        if scene != self._last or (timed and len(self._passes) < TIMED_PICTURES):
            request = _Request(scene, session.state, session.plan.target, divisor, saved=False, timed=timed)
            self._submit(request)

    def divisor(self, settings: ViewSettings, *, paused: bool) -> int:
        """Pixels of the camera per pixel drawn."""
        if paused or settings.detail == "full":
            return 1
        if settings.detail != "auto":
            return {"half": 2, "quarter": 4}[settings.detail]
        return self._detail.divisor

    def _submit(self, request: _Request) -> bool:
        labels = request.saved or self._kind.labels or False
        asked = FrameRequest(scene=request.scene, labels=labels, timed=request.timed)
        if not self._producer.submit(asked):
            return False
        self._asked_s = self._clock()
        self._last = request.scene
        if not self._waiting:
            self._waits_since_s = self._asked_s
        self._waiting.append(request)
        self._due_s = self._clock() + 0.7e-3 * self.frame_ms
        return True

    def _collect(self) -> None:
        try:
            for frame in self._producer.finished():
                self.write(frame)
        except PictureFailedError as error:
            request = self._waiting.pop(0)
            self._waits_since_s = self._clock()
            if request.discarded:
                return
            if not (request.saved and self.finished):
                raise
            # told each time, for each was asked for by itself
            self._told_failure = ""
            self._rest(error, "it is not saved")

    def write(self, frame: Frame) -> None:
        """Take the frame that was asked for the longest ago."""
        request = self._waiting.pop(0)
        self._waits_since_s = self._clock()
        if request.discarded:
            return
        self._account(frame, request)
        telemetry = telemetry_of(request.state.world, request.scene)
        self.newest = Picture(frame, request.state, request.target, telemetry, request.divisor)
        if request.saved:
            self.saved.append(self.newest)

    def _account(self, frame: Frame, request: _Request) -> None:
        now = self._clock()
        self.finished += 1
        self._told_failure = ""
        self._ends_s = [t for t in self._ends_s if now - t < 2.0] + [now]
        ms = sum(v for k, v in frame.stage_ms.items() if "." not in k and k != "labels")
        if request.saved or ms <= 0:
            return
        if request.timed:
            kept = [(c, p) for c, p in self._passes if c == request.scene.camera]
            self._passes = [*kept, (request.scene.camera, frame.stage_ms)][-TIMED_PICTURES:]
        else:
            self._passes = []
        # the last few of one size: the first of a kind also pays for textures and shaders
        if not self._costs or self._costs[-1][0] != request.scene.camera:
            self._costs = []
        self._costs = [*self._costs[-4:], (request.scene.camera, ms)]
        self.frame_ms = median(cost for _, cost in self._costs)
        self._detail.measured(request.divisor, ms, now)


def _made(make: Callable[[], SceneState]) -> SceneState:
    """Return the scene; raise `PictureFailedError` if it cannot be made."""
    try:
        return make()
    except (UserError, ValueError, ArithmeticError) as error:
        raise PictureFailedError(last_line(error)) from error


def last_line(error: Exception) -> str:
    """Return the last line of an error's message."""
    return (str(error).strip() or type(error).__name__).splitlines()[-1]


class AdaptiveResolution:
    """Chooses pixels of the camera per pixel drawn from what pictures of each size were seen to cost."""

    def __init__(self) -> None:
        self.divisor = 2
        self._skip = True
        self._ms: list[float] = []
        self._too_slow_until_s: dict[int, float] = {}

    def measured(self, divisor: int, ms: float, now_s: float) -> None:
        """Note what a picture cost, and change the size if it should be.

        Parameters
        ----------
        divisor : of the picture. ms : its cost. now_s : time, monotonic.
        """
        if divisor != self.divisor:
            return
        if self._skip:
            # the first one of a size also pays for buffers, the very first for textures and shaders
            self._skip = False
            return
        self._ms = [*self._ms[-4:], ms]
        if len(self._ms) < ENOUGH:
            return
        typical, k = median(self._ms), DIVISORS.index(divisor)
        if typical > LIVE_MS and k + 1 < len(DIVISORS):
            self._too_slow_until_s[divisor] = now_s + MEMORY_S
            self._change(DIVISORS[k + 1])
        elif k > 0:
            finer = DIVISORS[k - 1]
            # part of the cost does not grow with the pixels: hopeful, because a mistake is remembered
            hoped_ms = 0.7 * typical * (divisor / finer) ** 2
            if hoped_ms < LIVE_MS and now_s >= self._too_slow_until_s.get(finer, now_s):
                self._change(finer)

    def _change(self, divisor: int) -> None:
        self.divisor, self._skip, self._ms = divisor, True, []
