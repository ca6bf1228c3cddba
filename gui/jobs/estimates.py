"""The estimator beside the flight: any method on the newest picture, in its own process, one picture at a time.

The window never waits: results are polled, and a process that hangs or dies is restarted.
"""

from __future__ import annotations

import contextlib
import time
from collections import deque
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from flyaround.gui.jobs import estimator_process
from flyaround.gui.picture.decline_cause import decline_cause
from flyaround.hil.board.method_names import HYBRID
from flyaround.hil.evaluate.pose_errors import frame_errors
from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.readouts import duration_text
from flyaround.simulator.runtime.progress import ProgressLine
from flyaround.simulator.runtime.worker_pool import JobsLostError, WorkerPool

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

    from flyaround.gui.jobs.estimator_process import Answer
    from flyaround.gui.picture.feed import Picture

State = Literal["off", "starting", "waiting for a picture", "at work"]

LIMIT_S = 20.0
"""Time without processor use, while an answer is due, after which the process is restarted."""
SLOW_S = 3.0
"""Time after which the estimate's own time is shown."""
KEPT = 2000
"""Number of answers kept for the plots."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedEstimate:
    """An answer with the truth of its picture.

    Parameters
    ----------
    method : str
        Name of the method.
    t_s : float
        Simulated time of the picture.
    done_s : float
        Time of the answer, on the clock of `Estimates`.
    answer : Answer
        The estimated pose.
    range_m : float
        True distance of the target [m].
    E_R_deg : float or None
        Error of the attitude [deg]; None without a pose.
    E_T_m : float or None
        Error of the position [m]; None without a pose.
    size_px : tuple of int
        Width and height of the picture.
    cause : str, optional
        Why the picture is unfit, and what to do, if the estimate was declined.
    """

    method: str
    t_s: float
    done_s: float
    answer: Answer
    range_m: float
    E_R_deg: float | None
    E_T_m: float | None
    size_px: tuple[int, int]
    cause: str = ""

    @property
    def took_ms(self) -> float:
        """Time of all stages."""
        return sum(self.answer.stages_ms.values())


class Estimates:
    """Estimates by one method on the newest picture, repeated while it is on; call `update` once per turn.

    Parameters
    ----------
    open_resource : callable, optional
        Opens the resource of the process, by default the cache of estimators.
    work : callable, optional
        Function of the process.
    clock : callable, optional
        Monotonic time [s].
    """

    def __init__(
        self,
        *,
        open_resource: Callable[[], AbstractContextManager[Any]] | None = None,
        work: Callable[..., Answer] = estimator_process.estimate_picture,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.progress = ProgressLine()
        """Step until the first estimate of a method; empty after it."""
        self._open_resource = open_resource or partial(estimator_process.EstimatorCache, self.progress)
        self._work, self._clock = work, clock
        self.on = False
        self.method = HYBRID
        self.with_stages = False
        self.stage = ""
        """Stage that is shown large."""
        self.newest: ComparedEstimate | None = None
        self.history: deque[ComparedEstimate] = deque(maxlen=KEPT)
        self.restarts = 0
        self.refusal = ""
        """Reason why it went off by itself; empty otherwise."""
        self._troubles: list[str] = []
        self._worker: WorkerPool[Answer] | None = None
        self._under_way: tuple[Picture, str] | None = None
        self._discarded: tuple[Picture, str] | None = None
        self._last: object = None
        self._view: object = None
        self._answered = False
        self._since_s = 0.0

    # --- requests of the operator

    def start(self) -> None:
        """Run from the next picture on."""
        if not self.on:
            self.on, self._last, self.refusal = True, None, ""

    def stop(self) -> None:
        """Stop; the estimate in progress is abandoned."""
        self.on = False
        self._end_worker()

    def choose(self, method: str) -> None:
        """Continue with another method, abandoning the estimate in progress."""
        if method == self.method:
            return
        self.method, self._last, self.refusal = method, None, ""
        if self._under_way is not None:
            self._end_worker()

    def send_stages(self, *, on: bool) -> None:
        """Request pictures of the stages with each answer from now on, which doubles the time."""
        self.with_stages, self._last = on, None

    def forget(self) -> None:
        """Discard all answers, including the one in progress."""
        self.newest, self._last, self._discarded = None, None, self._under_way
        self.history.clear()

    @property
    def state(self) -> State:
        """State of the estimator."""
        if not self.on:
            return "off"
        if self._under_way is not None:
            return "at work"
        return "starting" if self._worker is None or not self._answered else "waiting for a picture"

    @property
    def doing(self) -> str:
        """State for people, with the time that the estimate under way has taken, or the rate, or the refusal."""
        if self._under_way is not None and (step := self.progress.read()):
            return f"preparing {step}, {duration_text(self.busy_s)}"
        if self.busy_s > SLOW_S:
            return f"{self.state} for {duration_text(self.busy_s)}"
        return f"{self.state}, {self.per_s:.1f}/s" if self.on and self.per_s else self.refusal or self.state

    @property
    def pid(self) -> int | None:
        """Identifier of the process, while there is one."""
        return None if self._worker is None else self._worker.pids[0]

    @property
    def per_s(self) -> float:
        """Answers per second, over the last ten."""
        last = list(self.history)[-10:]
        span = last[-1].done_s - last[0].done_s if len(last) > 1 else 0.0
        return (len(last) - 1) / span if span > 0 else 0.0

    def take_troubles(self) -> list[str]:
        """Return the failures since the last call, one sentence each."""
        troubles, self._troubles = self._troubles, []
        return troubles

    # --- once per turn

    def update(self, picture: Picture | None) -> bool:
        """Take an answer, if ready, and submit the newest picture; return True if an answer came. Never waits.

        Parameters
        ----------
        picture : Picture or None
            Newest picture of the sensor view.
        """
        # an estimate through another lens, or of another target, must not be drawn over this picture
        if picture is not None and (view := view_of(picture)) != self._view:
            self._view = view
            self.forget()
        before = self.newest
        if not self.on:
            return False
        try:
            self._turn(picture)
        except JobsLostError as error:
            self.restarts += 1
            self._forget_request()
            self._troubles.append(str(error))
        except UserError as error:
            self._give_up(str(error))
        except RuntimeError as error:
            # the last line of its traceback
            why = str(error).strip().splitlines()[-1]
            self._give_up(f"the estimator {estimator_process.method_title(self.method)} is off: {why}")
        return self.newest is not before

    def _turn(self, picture: Picture | None) -> None:
        if self._worker is None:
            self.progress.write(estimator_process.STEPS[0])
            self._worker = WorkerPool(
                self._work,
                1,
                open_resource=self._open_resource,
                capacity=1,
                name="estimator's process",
                restarts=True,
                answer_within_s=LIMIT_S,
                clock=self._clock,
            )
        if self._under_way is not None:
            if self._worker.ready():
                self._take(self._under_way, self._worker.result())
        elif picture is not None and picture.frame is not self._last:
            self._submit(self._worker, picture)

    @property
    def busy_s(self) -> float:
        """Elapsed time of the answer in progress [s]."""
        return 0.0 if self._under_way is None else self._clock() - self._since_s

    def _submit(self, worker: WorkerPool[Answer], picture: Picture) -> None:
        scene = picture.frame.scene
        worker.submit(
            estimator_process.EstimateRequest(
                method=self.method,
                camera=scene.camera,
                target=scene.target,
                image=picture.frame.image,
                t_s=scene.t_s,
                stages=self.with_stages,
            )
        )
        self._under_way, self._last, self._since_s = (picture, self.method), picture.frame, self._clock()

    def _take(self, under_way: tuple[Picture, str], answer: Answer) -> None:
        self._under_way, self._answered = None, True
        picture, method = under_way
        self.progress.write("")
        if under_way is self._discarded:
            return
        estimate = compared(picture, method, answer, self._clock())
        if self.history and estimate.t_s < self.history[-1].t_s:
            # the flight was restarted
            self.history.clear()
        self.history.append(estimate)
        self.newest = estimate

    # --- the process

    def _give_up(self, why: str) -> None:
        self.stop()
        self.refusal = why
        self._troubles.append(why)

    def _end_worker(self) -> None:
        """End the process at once."""
        worker, self._worker = self._worker, None
        self._forget_request()
        if worker is not None:
            worker.close()

    def _forget_request(self) -> None:
        """Request the abandoned estimate again, if it is switched on."""
        self._under_way = self._last = None
        self._answered = False
        self.progress.write("")

    close = stop


def view_of(picture: Picture) -> tuple[object, ...]:
    """Return what the pictures of one camera of one target share, at any detail: the lens, and the target's name."""
    c, d = picture.frame.scene.camera, picture.divisor
    lens = (c.fx_px * d, c.fy_px * d, (c.cx_px + 0.5) * d, (c.cy_px + 0.5) * d)
    return (*(round(x, 3) for x in lens), c.distortion, picture.target.name)


def compared(picture: Picture, method: str, answer: Answer, done_s: float) -> ComparedEstimate:
    """Return an estimate with the truth of its picture."""
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
        cause="" if answer.accepted else decline_cause(picture.frame, picture.target),
    )
