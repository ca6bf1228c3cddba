"""Availability of poses on the flight's clock: latency of a link, and faults of the line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.faults import Delay, Drop, Jitter

if TYPE_CHECKING:
    from flyaround.simulator.scenario.faults import Faults, LineFault

# Default latency from mid-exposure to a pose [s]: that of ``hybrid`` on a 1920 x 1200 image and a slow core.
LATENCY_S = 0.3

# Faults of the line that affect a link of poses.
SUPPORTED_FAULTS = (Delay, Jitter, Drop)


@dataclass(frozen=True, kw_only=True)
class PoseLink:
    """Link from an image to its pose in the filter, simulated on the flight's clock.

    Parameters
    ----------
    latency_s : float, optional
        Time from mid-exposure to the pose, without faults.
    faults : tuple of LineFault, optional
        Delays, jitters and drops of the line; a drop's probability is per image. Others are ignored.
    seed : int, optional
        Seed of the random draws, which depend only on it and the image's number.
    """

    latency_s: float = LATENCY_S
    faults: tuple[LineFault, ...] = ()
    seed: int = 0

    @staticmethod
    def in_lockstep(faults: Faults) -> PoseLink:
        """Return the link of a board in lockstep.

        Returns
        -------
        PoseLink
            Link with the delays and jitters of the line. It drops no poses, because the line itself loses them.
        """
        delays = tuple(fault for fault in faults.line if isinstance(fault, Delay | Jitter))
        return PoseLink(faults=delays, seed=faults.seed)

    @staticmethod
    def without_pictures(faults: Faults) -> PoseLink:
        """Return the link of simulated poses, without a board.

        Returns
        -------
        PoseLink
            Link with the delays, jitters and drops of the line.

        Raises
        ------
        UserError
            If there is a fault that only affects images or a line.
        """
        for fault in (*faults.camera, *faults.line):
            if not isinstance(fault, SUPPORTED_FAULTS):
                raise UserError(
                    f"a fault {fault.name!r} needs a board: fly on a board's poses, or leave it out; "
                    "without a board only delay, jitter and drop are possible"
                )
        return PoseLink(faults=faults.line, seed=faults.seed)

    def delay_s(self, number: int, t_s: float) -> float | None:
        """Return the delay of the pose of an image exposed at ``t_s``.

        Returns
        -------
        float or None
            Time from mid-exposure to the pose [s], the same at each call; None if the pose is lost.
        """
        delay_s = self.latency_s
        for k, fault in enumerate(self.faults):
            if not isinstance(fault, SUPPORTED_FAULTS) or not fault.acts(t_s):
                continue
            uniform = np.random.default_rng([self.seed, 2, k, number]).random()
            if isinstance(fault, Delay):
                delay_s += 1e-3 * fault.delay_ms
            elif isinstance(fault, Jitter):
                delay_s += 1e-3 * fault.most_ms * uniform
            elif uniform < fault.chance:
                return None
        return delay_s
