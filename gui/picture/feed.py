"""Live frames of a view: requests the newest state, at the rate and resolution that the renderer sustains."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from statistics import median
from typing import TYPE_CHECKING, Protocol

from flyaround.gui.picture.view_settings import apply_view_settings
from flyaround.simulator.errors import UserError
from flyaround.simulator.loop import FrameRequest
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
"""Number of pictures whose median pass times are shown."""
LIVE_MS = 90.0
"""Longest drawing time of a picture while the flight runs; a slower one lowers the resolution."""
DIVISORS = (1, 2, 3, 4)  # divisors of the camera's resolution, from the finest
ENOUGH = 3
"""Number of pictures whose median cost decides about a change of resolution."""
MEMORY_S = 15.0
"""Time for which a resolution that was too slow is not tried again."""
FAILED = "the console's render process failed ({}); run flyaround -vv sim for more, or flyaround doctor"
REST_S = 2.0
"""Delay before a failed picture is requested again."""
STALE_S = 2.0
"""Age at which a picture is marked as old."""
LEAST_SPAN_S = 0.5
"""Shortest time over which the rate of pictures is measured."""
SEEN_S = 0.5
"""Time after which a view that was not drawn counts as hidden and gets no pictures."""


class PictureFailedError(Exception):
    """The oldest requested picture could not be made; the message says why in one sentence."""


class FramesOnRequest(Protocol):
    """A frame producer as the feed uses it; its methods may raise `JobsLostError` and `PictureFailedError`."""

    def submit(self, request: FrameRequest) -> bool:
        """Request a frame; return False if enough are in flight."""

    def finished(self) -> Iterable[Frame]:
        """Return the frames finished since the last call, in order of request."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A finished frame, and the state of the flight that it shows."""

    frame: Frame
    state: FlightState
    target: Target
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
    scene : SceneOf, optional
        Function of session, settings, camera pixels per drawn pixel, and quality (None: the scene's own).
    labels : LabelRequest, optional
        Label layers of every picture.
    every_s : float, optional
        Least time between two pictures.
    title : str, optional
        Name of the view in messages.
    needed : bool, optional
        True if the console cannot run without it.
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
    """A view's stream of pictures: one in progress and, shortly before it is due, another queued.

    Parameters
    ----------
    producer : FramesOnRequest
        Renderer in another process, because the UI thread owns the window's context. `Turns` schedules it among
        several feeds.
    clock : callable, optional
        Monotonic time [s].
    kind : PictureKind, optional
        Kind of the pictures.
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
        self._requested_s = self._seen_s = -1e9
        self._waiting: list[_Request] = []
        self._detail = AdaptiveResolution()
        self._last: SceneState | None = None
        self._session: FlightSession | None = None
        self._save_due = self._refused = False
        self._due_s = self._waits_since_s = 0.0
        self.newest: Picture | None = None
        self.saved: list[Picture] = []
        self.finished = 0
        self.frame_ms = 0.0
        self.restarts = 0
        self._trouble: str | None = None
        self._reported_failure = ""
        self._rests_until_s = -1e9
        self._ends_s: list[float] = []
        self._costs: list[tuple[Camera, float]] = []
        self._passes: list[tuple[Camera, dict[str, float]]] = []

    def ask_to_save(self) -> None:
        """Request the present scene at full resolution, with labels; the result is appended to `saved`."""
        self._save_due = True

    @property
    def saving(self) -> bool:
        """True while a picture to be saved is in flight."""
        return self._save_due or any(r.saved for r in self._waiting)

    def look(self) -> Picture | None:
        """Mark the view as visible now; `looked_at` stays true for `SEEN_S`.

        Returns
        -------
        Picture or None
            The newest picture.
        """
        self._seen_s = self._clock()
        return self.newest

    @property
    def waiting(self) -> bool:
        """True while a picture is in flight."""
        return bool(self._waiting)

    @property
    def looked_at(self) -> bool:
        """True while the view that shows these pictures is visible."""
        return self._clock() - self._seen_s < SEEN_S

    @property
    def pass_ms(self) -> dict[str, float]:
        """Median times of the passes of recent pictures [ms]; empty without timed pictures."""
        if not self._passes:
            return {}
        return {name: median(p.get(name, 0.0) for _, p in self._passes) for name in self._passes[-1][1]}

    def update(self, session: FlightSession, settings: ViewSettings, *, timed: bool = False) -> bool:
        """Take finished pictures and request new ones.

        Parameters
        ----------
        session : FlightSession
            The flight to draw.
        settings : ViewSettings
            Settings of the view.
        timed : bool, optional
            True to time each pass, which is slightly slower.

        Returns
        -------
        bool
            True if there is a new picture.

        Raises
        ------
        UserError
            If the renderer failed and cannot be restarted, or the first picture of a required view failed.
        """
        before = self.finished
        if session is not self._session:
            self._begin(session)
        try:
            self._collect()
            self._ask(session, settings, timed=timed)
        except JobsLostError as error:
            self._ask_again(error)
        except (PictureFailedError, RuntimeError) as error:
            lost = not self.finished or isinstance(error, RuntimeError)
            if self._kind.needed and lost:
                raise UserError(FAILED.format(last_line(error))) from error
            self._rest(error)
        return self.finished > before

    def _begin(self, session: FlightSession) -> None:
        """Discard pictures of the previous flight, also those in flight."""
        self._save_due &= self._session is None
        self._session, self.newest, self._last = session, None, None
        self._waiting = [replace(r, discarded=True) for r in self._waiting]
        self._requested_s, self._ends_s, self._refused = -1e9, [], False

    @property
    def late_s(self) -> float:
        """Time since the last picture [s], if the next one is overdue; else 0."""
        late_s = self._clock() - self._waits_since_s if self._waiting or self._refused else 0.0
        return late_s if late_s > STALE_S else 0.0

    @property
    def frames_s(self) -> float:
        """Pictures per second."""
        if len(self._ends_s) < 2 or self.late_s:
            return 0.0
        # a lower bound, because pictures that arrive together would give an infinite rate
        return (len(self._ends_s) - 1) / max(self._ends_s[-1] - self._ends_s[0], LEAST_SPAN_S)

    def take_trouble(self) -> str | None:
        """Return why pictures were lost or failed, once.

        Returns
        -------
        str or None
            Sentence of the last failure since the previous call; None if there was none.
        """
        trouble, self._trouble = self._trouble, None
        return trouble

    def _ask_again(self, error: JobsLostError) -> None:
        """Drop lost requests; request a picture to be saved again."""
        self.restarts += 1
        if self._kind.needed:
            # every feed lost its requests to the same failure: only one reports it
            self._trouble = str(error)
        self._save_due = self.saving
        self._waiting, self._last = [], None

    def _rest(self, error: Exception, then: str = "the console tries again") -> None:
        """Report a failure, unless it repeats the previous one, and pause requests for `REST_S`."""
        self._rests_until_s = self._clock() + REST_S
        self._last = None
        message = f"no picture of the {self._kind.title}: {last_line(error)}; {then}"
        if message != self._reported_failure:
            self._reported_failure = self._trouble = message

    def _ask(self, session: FlightSession, settings: ViewSettings, *, timed: bool) -> None:
        enough = len(self._waiting) >= 2 or (self._waiting and self._clock() < self._due_s)
        if enough or self._clock() < self._rests_until_s:
            return
        if self._save_due:
            scene = _checked(lambda: apply_view_settings(session.scene(), settings))
            if self._submit(_Request(scene, session.state, session.plan.target, 1, saved=True, timed=False)):
                self._save_due = False
            return
        if self._clock() - self._requested_s < self._kind.every_s:
            return
        divisor = self.divisor(settings, paused=session.clock.paused)
        quality: Quality | None = None if session.clock.paused else "draft"
        scene = _checked(lambda: self._kind.scene(session, settings, divisor, quality))
        # if nothing moves, the present picture stays, unless its passes are to be timed
        if scene != self._last or (timed and len(self._passes) < TIMED_PICTURES):
            request = _Request(scene, session.state, session.plan.target, divisor, saved=False, timed=timed)
            self._submit(request)

    def divisor(self, settings: ViewSettings, *, paused: bool) -> int:
        """Return the divisor of the camera's resolution.

        Returns
        -------
        int
            Camera pixels per drawn pixel, in each direction: 1 at full detail or while paused, at most 4.
        """
        chosen = {"full": 1, "half": 2, "quarter": 4}
        return 1 if paused else chosen.get(settings.detail, self._detail.divisor)

    def _submit(self, request: _Request) -> bool:
        labels = request.saved or self._kind.labels or False
        frame_request = FrameRequest(scene=request.scene, labels=labels, timed=request.timed)
        if not (self._waiting or self._refused):
            self._waits_since_s = self._clock()
        self._refused = not self._producer.submit(frame_request)
        if self._refused:
            return False
        self._requested_s = self._clock()
        self._last = request.scene
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
            # reported each time, because each was requested separately
            self._reported_failure = ""
            self._rest(error, "the picture is not saved")

    def write(self, frame: Frame) -> None:
        """Store a frame as the newest picture; frames arrive in the order of their requests."""
        request = self._waiting.pop(0)
        self._waits_since_s = self._clock()
        if request.discarded:
            return
        self._account(frame, request)
        self.newest = Picture(frame, request.state, request.target, request.divisor)
        if request.saved:
            self.saved.append(self.newest)

    def _account(self, frame: Frame, request: _Request) -> None:
        now = self._clock()
        self.finished += 1
        self._reported_failure = ""
        self._ends_s = [t for t in self._ends_s if now - t < 2.0] + [now]
        ms = sum(v for k, v in frame.stage_ms.items() if "." not in k and k != "labels")
        if request.saved or ms <= 0:
            return
        if request.timed:
            same_size = [(c, p) for c, p in self._passes if c == request.scene.camera]
            self._passes = [*same_size, (request.scene.camera, frame.stage_ms)][-TIMED_PICTURES:]
        else:
            self._passes = []
        # the last few of one size: the first also pays for textures and shaders
        same_camera = [(c, cost) for c, cost in self._costs if c == request.scene.camera]
        self._costs = [*same_camera[-4:], (request.scene.camera, ms)]
        self.frame_ms = median(cost for _, cost in self._costs)
        self._detail.measured(request.divisor, ms, now)


def _checked(make: Callable[[], SceneState]) -> SceneState:
    """Return the scene; raise `PictureFailedError` if it cannot be made."""
    try:
        return make()
    except (UserError, ValueError, ArithmeticError) as error:
        raise PictureFailedError(last_line(error)) from error


def last_line(error: Exception) -> str:
    """Return the last line of an error's message."""
    return (str(error).strip() or type(error).__name__).splitlines()[-1]


class AdaptiveResolution:
    """Controller of the resolution: chooses the camera pixels per drawn pixel from the measured drawing times."""

    def __init__(self) -> None:
        self.divisor = 2
        self._skip = True
        self._ms: list[float] = []
        self._too_slow_until_s: dict[int, float] = {}

    def measured(self, divisor: int, ms: float, now_s: float) -> None:
        """Record a picture's drawing time; choose a coarser or finer resolution if it is above or below `LIVE_MS`.

        Parameters
        ----------
        divisor : int
            Camera pixels per drawn pixel.
        ms : float
            Time to draw the picture.
        now_s : float
            Monotonic time.
        """
        if divisor != self.divisor:
            return
        if self._skip:
            # the first picture of a size also pays for buffers, the very first for textures and shaders
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
            # part of the cost does not scale with the pixels: be optimistic, because failures are remembered
            hoped_ms = 0.7 * typical * (divisor / finer) ** 2
            if hoped_ms < LIVE_MS and now_s >= self._too_slow_until_s.get(finer, now_s):
                self._change(finer)

    def _change(self, divisor: int) -> None:
        self.divisor, self._skip, self._ms = divisor, True, []
