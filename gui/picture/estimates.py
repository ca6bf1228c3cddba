"""The estimator beside the flight: any method on the newest picture, in a process of its own, one picture at a time.

The window never waits for it: what is under way is polled, and a process that hangs or dies is ended and started again.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np

from flyaround.hil.evaluate.pose_errors import frame_errors
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.plugins import plugins
from flyaround.simulator.runtime.worker import ProcessDiedError, ProgressWatch, WorkerProcess

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

    from numpy.typing import NDArray

    from flyaround.gui.picture.feed import Picture
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import ByteArray, Quat, Vec3
    from flyaround.simulator.scene.state import TargetRef

State = Literal["off", "starting", "waiting", "estimating"]

LIMIT_S = 20.0
"""A process that has done nothing for so long while an answer is due hangs. Making an estimator may take minutes."""
MOST_DEATHS = 3
"""Processes that end one after the other without an answer before it is left off."""
KEPT = 2000
"""Answers that are kept for the plots."""
STAGE_QUALITY = 88
KEPT_ESTIMATORS = 4
NICENESS = 5
"""Window and pictures go first where there are few processors."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EstimateRequest:
    """One picture to be estimated.

    Parameters
    ----------
    t_s : mid-exposure, for a method that follows the target. stages : whether pictures of the stages are wanted.
    """

    method: str
    camera: Camera
    target: TargetRef
    image: NDArray[np.unsignedinteger]
    t_s: float
    stages: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """What the process says of a picture; ``stages`` holds a JPEG file of each stage by name."""

    accepted: bool
    reason: str
    q_camera_from_target_wxyz: Quat | None
    t_camera_from_target_m: Vec3 | None
    confidence: float
    stages_ms: dict[str, float]
    counts: dict[str, int]
    making_ms: float = 0.0
    stages: dict[str, ByteArray] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedEstimate:
    """One answer beside the truth of its picture.

    Parameters
    ----------
    t_s : simulated time of the picture. done_s : when it was known, on the clock of `Estimates`.
    E_R_deg, E_T_m : errors against the truth; None without a pose. took_ms : of the whole estimate.
    size_px : width and height of the picture.
    """

    method: str
    t_s: float
    done_s: float
    answer: Answer
    range_m: float
    E_R_deg: float | None
    E_T_m: float | None
    size_px: tuple[int, int]

    @property
    def took_ms(self) -> float:
        """Time of all stages."""
        return sum(self.answer.stages_ms.values())


class EstimatesByProcess:
    """What the process holds: a few estimators, made when a method, a camera or a craft is first asked for."""

    info = "ready"

    def __init__(self) -> None:
        self._made: dict[tuple[str, Camera, TargetRef], Any] = {}

    def __enter__(self) -> Self:
        with contextlib.suppress(OSError):
            os.nice(NICENESS)
        return self

    def __exit__(self, *_: object) -> None:
        self._made.clear()

    def estimator(self, request: EstimateRequest) -> Any:  # noqa: ANN401 - any of them
        """The estimator of a request.

        Raises
        ------
        UserError
            If there is no such method.
        """
        import msgspec  # noqa: PLC0415 - what only this process needs

        from flyaround.hil.board.errors import BoardModelError  # noqa: PLC0415
        from flyaround.hil.board.svd import CameraIntrinsics  # noqa: PLC0415
        from flyaround.hil.evaluate.added_estimators import any_estimator, check_any_method  # noqa: PLC0415
        from flyaround.hil.evaluate.method_choice import MethodChoice, board_model  # noqa: PLC0415

        key = (request.method, request.camera, request.target)
        if key not in self._made:
            try:
                check_any_method(request.method)
                made = any_estimator(
                    board_model(request.target.drawn()),
                    CameraIntrinsics.from_dict(msgspec.to_builtins(request.camera)),
                    MethodChoice(request.method),
                )
            except BoardModelError as error:
                raise UserError(f"the estimator cannot be made: {error}") from error
            while len(self._made) >= KEPT_ESTIMATORS:
                self._made.pop(next(iter(self._made)))
            self._made[key] = made
        return self._made[key]


def estimate_picture(held: EstimatesByProcess, request: EstimateRequest) -> Answer:
    """Estimate the pose in a picture, in the estimator's process."""
    from flyaround.hil.board.svd.debug.stage_pictures import stage_pictures  # noqa: PLC0415 - what only this process needs
    from flyaround.hil.evaluate.estimate import checked_picture  # noqa: PLC0415

    start = time.perf_counter()
    estimator = held.estimator(request)
    making_ms = 1e3 * (time.perf_counter() - start)
    image = checked_picture(request.image, request.camera, "the picture")
    trace: dict[str, Any] | None = {"every_stage": True} if request.stages else None
    result = estimator.estimate(image, trace, request.t_s)
    stages = {}
    if trace is not None:
        pictures = stage_pictures(image, trace, result, estimator.model, estimator.camera)
        stages = {name: _jpeg(picture) for name, picture in pictures.items()}
    q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
    return Answer(
        accepted=bool(result.accepted),
        reason=str(result.reason),
        q_camera_from_target_wxyz=None if q is None else (float(q[0]), float(q[1]), float(q[2]), float(q[3])),
        t_camera_from_target_m=None if t is None else (float(t[0]), float(t[1]), float(t[2])),
        confidence=float(result.confidence),
        stages_ms={k: float(v) for k, v in result.stages_ms.items()},
        counts={k: int(v) for k, v in getattr(result, "counts", {}).items()},
        making_ms=making_ms,
        stages=stages,
    )


def _jpeg(picture: ByteArray) -> ByteArray:
    import cv2  # noqa: PLC0415 - what only this process needs

    ok, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, STAGE_QUALITY])
    if not ok:
        raise RuntimeError("a stage's picture could not be encoded")
    return np.asarray(data, np.uint8).reshape(-1)


def known_methods() -> tuple[str, ...]:
    """Names that need no file: the built-in methods, and those of other packages."""
    from flyaround.hil.board.svd import METHODS  # noqa: PLC0415 - loads OpenCV, and most flights have no estimator

    return (*METHODS, *sorted(plugins("estimator")))


class Estimates:
    """Runs a method on the newest picture, again and again while it is on; `update` is called once a turn.

    Parameters
    ----------
    open_resource, work : of the process; tests give their own.
    limit_s : a process that uses no processor time for so long is restarted. clock : seconds, monotonic.
    """

    def __init__(
        self,
        *,
        open_resource: Callable[[], AbstractContextManager[Any]] = EstimatesByProcess,
        work: Callable[..., Answer] = estimate_picture,
        limit_s: float = LIMIT_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._open_resource, self._work, self._clock = open_resource, work, clock
        self._limit_s, self._progress = limit_s, ProgressWatch(clock)
        self.on = False
        self.method = "svd"
        self.stages_wanted = False
        self.newest: ComparedEstimate | None = None
        self.history: deque[ComparedEstimate] = deque(maxlen=KEPT)
        self.restarts = 0
        self._troubles: list[str] = []
        self._worker: WorkerProcess[Answer] | None = None
        self._under_way: tuple[Picture, str] | None = None
        self._discarded: tuple[Picture, str] | None = None
        self._last: object = None
        self._answered = False
        self._deaths = 0
        self._since_s = 0.0

    # --- what the operator asks for

    def start(self) -> None:
        """Run from the next picture on."""
        if not self.on:
            self.on, self._deaths, self._last = True, 0, None

    def stop(self) -> None:
        """Run no more; what is under way is given up."""
        self.on = False
        self._end_worker()

    def choose(self, method: str) -> None:
        """Go on with another method; what an earlier one is at is given up."""
        if method == self.method:
            return
        self.method, self._last, self._deaths = method, None, 0
        if self._under_way is not None:
            self._end_worker()

    def want_stages(self, *, wanted: bool) -> None:
        """Have pictures of the stages with each answer from now on; they take as long again."""
        self.stages_wanted, self._last = wanted, None

    def forget(self) -> None:
        """Forget all answers; the one under way is discarded when it comes."""
        self.newest, self._last, self._discarded = None, None, self._under_way
        self.history.clear()

    @property
    def state(self) -> State:
        """What it is at."""
        if not self.on:
            return "off"
        if self._under_way is not None:
            return "estimating"
        return "starting" if self._worker is None or not self._answered else "waiting"

    @property
    def pid(self) -> int | None:
        """Number of the process, while there is one."""
        return None if self._worker is None else self._worker.pid

    @property
    def per_s(self) -> float:
        """Answers a second, over the last ten."""
        last = list(self.history)[-10:]
        span = last[-1].done_s - last[0].done_s if len(last) > 1 else 0.0
        return (len(last) - 1) / span if span > 0 else 0.0

    def take_troubles(self) -> list[str]:
        """What went wrong since the last call, each in one sentence."""
        troubles, self._troubles = self._troubles, []
        return troubles

    # --- once a turn

    def update(self, picture: Picture | None) -> bool:
        """Take an answer that is there, and give the newest picture; whether an answer came. Never waits.

        Parameters
        ----------
        picture : the newest of the sensor view.
        """
        before = self.newest
        if not self.on:
            return False
        try:
            self._turn(picture)
        except ProcessDiedError as error:
            self._restart(f"its process died (exit code {error.exit_code})")
        except UserError as error:
            self._give_up(str(error))
        except RuntimeError as error:
            # the last line of its traceback
            self._give_up(f"the estimator failed: {str(error).strip().splitlines()[-1]}")
        return self.newest is not before

    def _turn(self, picture: Picture | None) -> None:
        if self._worker is None:
            self._worker = WorkerProcess(
                self._work, open_resource=self._open_resource, capacity=1, name="estimator's process"
            )
            self._since_s = self._clock()
            self._progress.restart()
        if self._under_way is not None:
            if self._worker.ready():
                self._take(self._worker.result())
            else:
                self._end_hanging(self._worker)
            return
        if not self._worker.started:
            self._end_hanging(self._worker)
            return
        if picture is not None and picture.frame is not self._last:
            self._submit(self._worker, picture)

    def _end_hanging(self, worker: WorkerProcess[Answer]) -> None:
        idle_s = self._progress.idle_s(worker.processor_time_s())
        if idle_s > self._limit_s:
            self._restart(f"it has done nothing for {idle_s:.0f} s")

    @property
    def busy_s(self) -> float:
        """Time that the answer under way, or the start of the process, has taken so far [s]."""
        return 0.0 if self._worker is None else self._clock() - self._since_s

    def _submit(self, worker: WorkerProcess[Answer], picture: Picture) -> None:
        scene = picture.frame.scene
        worker.submit(
            EstimateRequest(
                method=self.method,
                camera=scene.camera,
                target=scene.target,
                image=picture.frame.image,
                t_s=scene.t_s,
                stages=self.stages_wanted,
            )
        )
        self._under_way, self._last, self._since_s = (picture, self.method), picture.frame, self._clock()
        self._progress.restart()

    def _take(self, answer: Answer) -> None:
        if self._under_way is None:
            raise RuntimeError("an answer came that nobody asked for")
        under_way, self._under_way = self._under_way, None
        picture, method = under_way
        self._deaths = 0
        self._answered = True
        if under_way is self._discarded:
            return
        estimate = compared(picture, method, answer, self._clock())
        if self.history and estimate.t_s < self.history[-1].t_s:
            # the flight was begun again
            self.history.clear()
        self.history.append(estimate)
        self.newest = estimate

    # --- the process

    def _restart(self, why: str) -> None:
        self._deaths += 1
        self.restarts += 1
        if self._deaths >= MOST_DEATHS:
            self._give_up(f"the estimator {self.method} is off: {why}, {MOST_DEATHS} times in a row")
            return
        self._end_worker()
        self._troubles.append(f"the estimator {self.method} is started again: {why}; the flight goes on")

    def _give_up(self, why: str) -> None:
        self.stop()
        self._troubles.append(why)

    def _end_worker(self) -> None:
        """End the process at once; one that hangs is not asked."""
        worker, self._worker = self._worker, None
        # what was under way is asked for again, should it run on
        self._under_way = self._last = None
        self._answered = False
        if worker is not None:
            worker.kill()
            worker.close()

    def close(self) -> None:
        """End the process."""
        self.stop()


def compared(picture: Picture, method: str, answer: Answer, done_s: float) -> ComparedEstimate:
    """An answer beside the truth of its picture."""
    scene = picture.frame.scene
    q, t = answer.q_camera_from_target_wxyz, answer.t_camera_from_target_m
    turn = shift = None
    if q is not None and t is not None:
        with contextlib.suppress(ValueError):
            shift, _, turn = frame_errors(scene.q_camera_from_target_wxyz, scene.t_camera_from_target_m, q, t)
    return ComparedEstimate(
        method=method,
        t_s=scene.t_s,
        done_s=done_s,
        answer=answer,
        range_m=float(np.linalg.norm(scene.t_camera_from_target_m)),
        E_R_deg=turn,
        E_T_m=shift,
        size_px=(picture.frame.image.shape[1], picture.frame.image.shape[0]),
    )
