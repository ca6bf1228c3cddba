"""Poses without images: the truth, or the truth with simulated errors of an estimator."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Protocol

import numpy as np

from flyaround.simulator.world.frames.rotation import quat_from_rotvec, quat_multiply, rotvec_between

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.random import Generator

    from flyaround.hil.navigation.measurement import PoseMeasurement, PoseNoise, Snapshot
    from flyaround.simulator.runtime.arrays import FloatArray


class PoseSource(Protocol):
    """Source of poses: exposes on request, and answers with a delay."""

    def expose(self, snapshot: Snapshot) -> None:
        """Expose an image at this moment."""

    def available(self, t_s: float) -> Sequence[PoseMeasurement]:
        """Return the poses available by ``t_s`` that were not returned before."""


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
        """Return the pose of a snapshot with random errors; None if no pose is accepted.

        A grossly wrong pose has a random rotation and is displaced by a tenth of the range.
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
        pose = self._noise.measured(snapshot.t_s, q, t, snapshot.q_camera_from_eci_wxyz)
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


class LatePoses:
    """Queue of poses that become available a constant delay after exposure."""

    def __init__(self, latency_s: float) -> None:
        self._latency_s = latency_s
        self._waiting: deque[PoseMeasurement] = deque()

    def wait(self, pose: PoseMeasurement) -> None:
        """Store a pose until its delay has passed."""
        self._waiting.append(pose)

    def available(self, t_s: float) -> Sequence[PoseMeasurement]:
        """Return the poses whose delay has passed."""
        ready = []
        while self._waiting and self._waiting[0].t_s + self._latency_s <= t_s + 1e-9:
            ready.append(self._waiting.popleft())
        return ready


class NoisyPoses(LatePoses):
    """Truth with the errors of an estimator, after a constant delay.

    Parameters
    ----------
    noise : PoseNoise
        Noise model of the poses.
    latency_s : float
        Time from mid-exposure to the answer.
    seed : int
        Seed of the errors.
    """

    def __init__(self, noise: PoseNoise, latency_s: float, seed: int) -> None:
        super().__init__(latency_s)
        self._errors = PoseErrors(noise, np.random.default_rng([seed, 0]))

    def expose(self, snapshot: Snapshot) -> None:
        """Draw the errors of this moment's pose."""
        pose = self._errors.draw(snapshot)
        if pose is not None:
            self.wait(pose)


class TruePoses(LatePoses):
    """Exact truth after a constant delay; the filter nevertheless assumes the accuracy of ``noise``."""

    def __init__(self, noise: PoseNoise, latency_s: float) -> None:
        super().__init__(latency_s)
        self._noise = noise

    def expose(self, snapshot: Snapshot) -> None:
        """Record the pose of this moment."""
        q, t = snapshot.pose()
        self.wait(self._noise.measured(snapshot.t_s, q, t, snapshot.q_camera_from_eci_wxyz))
