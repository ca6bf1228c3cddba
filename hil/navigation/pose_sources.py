"""Poses without images: the truth, or the truth with simulated errors of an estimator."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.frames.rotation import quat_from_rotvec, quat_multiply, rotvec_between

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.random import Generator

    from flyaround.hil.navigation.measurement import PoseMeasurement, PoseNoise, Snapshot
    from flyaround.simulator.runtime.arrays import FloatArray


class PoseErrors:
    """Correlated random errors of one run's poses.

    Parameters
    ----------
    noise : PoseNoise
        Noise model of the poses.
    rng : Generator
        Random generator, new for each run.
    """

    def __init__(self, noise: PoseNoise, rng: Generator) -> None:
        self._noise, self._rng = noise, rng
        self._bias = rng.standard_normal(6)
        self._previous: tuple[FloatArray, FloatArray] | None = None

    def draw(self, snapshot: Snapshot) -> PoseMeasurement | None:
        """Draw the pose of a snapshot with random errors.

        A grossly wrong pose has a random rotation and is displaced by a tenth of the range.

        Returns
        -------
        PoseMeasurement or None
            Pose with errors, and the covariance that the noise model assigns to it; None if no pose is accepted.
        """
        q, t = snapshot.pose()
        # always draw the same numbers, so that runs differ only by their seed
        innovation, new_noise = self._rng.standard_normal((2, 6))
        is_accepted, is_wrong = self._rng.random(2) < (self._noise.available, self._noise.wrong)
        gross_error = self._rng.standard_normal(6)
        if self._previous is not None:
            angle_rad = float(np.linalg.norm(rotvec_between(self._previous[0], q)))
            ratio = float(np.linalg.norm(t) / np.linalg.norm(self._previous[1]))
            correlation = self._noise.memory.correlation(angle_rad, ratio)
            self._bias = correlation * self._bias + np.sqrt(1.0 - correlation * correlation) * innovation
        self._previous = q, t
        if not is_accepted:
            return None
        pose = self._noise.true_pose(snapshot)
        new = pose.new_errors()
        error = pose.correlated_errors() @ self._bias + np.linalg.cholesky(new @ new.T) @ new_noise
        if is_wrong:
            error = np.concatenate([0.1 * np.linalg.norm(t) * gross_error[:3], 2.0 * gross_error[3:]])
        return self._noise.measured(
            snapshot.t_s,
            quat_multiply(q, quat_from_rotvec(error[3:])),
            t + error[:3],
            snapshot.q_camera_from_eci_wxyz,
        )


class PoseQueue:
    """Poses in transit from the estimator to the filter, which arrive in the order of their exposures.

    Parameters
    ----------
    delay_s : callable
        Returns the time from exposure to arrival, or None for a lost pose, by the number of the image and the time of
        its exposure.
    """

    def __init__(self, delay_s: Callable[[int, float], float | None]) -> None:
        self._delay_s = delay_s
        self._waiting: deque[tuple[float, PoseMeasurement]] = deque()
        self._last_s = -np.inf

    def put(self, number: int, pose: PoseMeasurement) -> None:
        """Add the pose of an image, by the image's number."""
        delay_s = self._delay_s(number, pose.t_s)
        if delay_s is not None:
            self._last_s = max(self._last_s, pose.t_s + delay_s)
            self._waiting.append((self._last_s, pose))

    def available(self, t_s: float) -> Sequence[PoseMeasurement]:
        """Return the poses that have arrived since the last call, and remove them.

        Returns
        -------
        sequence of PoseMeasurement
            Poses that have arrived by ``t_s``, in the order of their images; empty if there is none.
        """
        ready = []
        while self._waiting and self._waiting[0][0] <= t_s + 1e-9:
            ready.append(self._waiting.popleft()[1])
        return ready


class SimulatedPoses(PoseQueue):
    """Poses without images, derived from the truth.

    Parameters
    ----------
    draw : callable
        Returns the pose of a snapshot, or None if no pose is accepted: `PoseNoise.true_pose` or `PoseErrors.draw`.
    delay_s : callable
        See `PoseQueue`.
    """

    def __init__(
        self,
        draw: Callable[[Snapshot], PoseMeasurement | None],
        delay_s: Callable[[int, float], float | None],
    ) -> None:
        super().__init__(delay_s)
        self._draw, self._number = draw, 0

    def expose(self, snapshot: Snapshot) -> None:
        """Expose an image at this moment."""
        pose = self._draw(snapshot)
        if pose is not None:
            self.put(self._number, pose)
        self._number += 1
