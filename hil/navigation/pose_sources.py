"""Where poses come from without a picture: the truth, or the truth with the errors of an estimator."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Protocol

import numpy as np

from hil.navigation.measurement import PoseMeasurement, PoseNoise, Snapshot

if TYPE_CHECKING:
    from collections.abc import Sequence


class PoseSource(Protocol):
    """Looks at what was flown, and answers some time later."""

    def look(self, snapshot: Snapshot) -> None:
        """The camera exposes a picture of this moment."""

    def arrived(self, t_s: float) -> Sequence[PoseMeasurement]:
        """Poses whose answers have come by ``t_s`` and were not handed out before."""


class NoisyPoses:
    """The truth with errors of an estimator, a constant while after the exposure.

    Parameters
    ----------
    noise : of the poses. latency_s : from mid-exposure to the answer. seed : of the errors.
    """

    def __init__(self, noise: PoseNoise, latency_s: float, seed: int) -> None:
        self._noise, self._latency_s = noise, latency_s
        self._rng = np.random.default_rng([seed, 0])
        self._waiting: deque[PoseMeasurement] = deque()

    def look(self, snapshot: Snapshot) -> None:
        """Draw the errors of this moment's pose."""
        pose = self._noise.draw(snapshot, self._rng)
        if pose is not None:
            self._waiting.append(pose)

    def arrived(self, t_s: float) -> Sequence[PoseMeasurement]:
        """Poses of pictures that are old enough."""
        ready = []
        while self._waiting and self._waiting[0].t_s + self._latency_s <= t_s + 1e-9:
            ready.append(self._waiting.popleft())
        return ready


class TruePoses:
    """The truth itself, as late; the filter is told the accuracy of ``noise`` all the same."""

    def __init__(self, noise: PoseNoise, latency_s: float) -> None:
        self._noise, self._latency_s = noise, latency_s
        self._waiting: deque[PoseMeasurement] = deque()

    def look(self, snapshot: Snapshot) -> None:
        """Note the pose of this moment."""
        q, t = snapshot.pose()
        self._waiting.append(
            PoseMeasurement(
                t_s=snapshot.t_s,
                q_camera_from_target_wxyz=q,
                t_camera_from_target_m=t,
                q_camera_from_eci_wxyz=snapshot.q_camera_from_eci_wxyz,
                covariance=self._noise.covariance(t),
            )
        )

    def arrived(self, t_s: float) -> Sequence[PoseMeasurement]:
        """Poses of pictures that are old enough."""
        ready = []
        while self._waiting and self._waiting[0].t_s + self._latency_s <= t_s + 1e-9:
            ready.append(self._waiting.popleft())
        return ready
