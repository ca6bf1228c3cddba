"""Automatic exposure: a lagged control loop that depends on the flight alone, not on which frames are drawn."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

import numpy as np
from msgspec import Meta

from flyaround.simulator.camera.detector.shutter import EXPOSURE_S
from flyaround.simulator.runtime.sections import Section, within

if TYPE_CHECKING:
    from collections.abc import Callable

STEPS_PER_LAG = 2
MEMORY_LAGS = 12
"""Lags after which earlier values have decayed below 1e-5 and are ignored."""


class AutoExposure(Section, frozen=True, kw_only=True):
    """Automatic exposure that follows the scene with lag, in place of ``exposure_s``.

    ``level``: signal, 1 at full scale, that a ``share`` of the lit image area stays below.
    """

    # the metered radiance is brought to the level; share is by area
    level: Annotated[float, Meta(gt=0, le=1)] = 0.5
    share: Annotated[float, Meta(gt=0, le=1)] = 0.9
    # time constant of the logarithm of the exposure
    lag_s: Annotated[float, Meta(ge=0.01, le=600)] = 2.0
    # limits; if nothing is lit, the longest is used
    shortest_s: Annotated[float, within(EXPOSURE_S)] = 1e-5
    longest_s: Annotated[float, within(EXPOSURE_S)] = 0.1

    def wanted_s(self, radiance_w_m2_sr: float, full_scale_j_m2_sr: float) -> float:
        """Return the exposure that brings a radiance to the level [s].

        Parameters
        ----------
        full_scale_j_m2_sr : float
            Radiance times exposure at full scale.
        """
        if radiance_w_m2_sr <= 0:
            return self.longest_s
        exposure_s = self.level * full_scale_j_m2_sr / radiance_w_m2_sr
        return float(np.clip(exposure_s, self.shortest_s, self.longest_s))


@dataclass(frozen=True, eq=False)
class ExposureTrack:
    """The exposure along a flight, from the meter's values at fixed times.

    The loop runs on a grid of ``lag_s / 2`` from the flight's start. At one time the last twelve lags determine it, so
    it is a function of time, independent of which frames are drawn.

    Parameters
    ----------
    wanted_s : callable
        Function from a time since the flight's start to the metered exposure [s].
    """

    settings: AutoExposure
    wanted_s: Callable[[float], float]
    _known: dict[int, float] = field(default_factory=dict)

    def exposure_s(self, t_s: float) -> float:
        """Return the exposure at ``t_s``; the loop is settled at the flight's start."""
        step = self.settings.lag_s / STEPS_PER_LAG
        last = int(np.floor(t_s / step + 1e-9))
        first = max(0, last - STEPS_PER_LAG * MEMORY_LAGS)
        log = np.log(self._metered_s(first, step))
        for k in range(first, last + 1):
            span = step if k < last else t_s - last * step
            wanted = np.log(self._metered_s(k, step))
            log = wanted + (log - wanted) * np.exp(-max(span, 0.0) / self.settings.lag_s)
        return float(np.exp(log))

    def _metered_s(self, k: int, step_s: float) -> float:
        if k not in self._known:
            self._known[k] = self.wanted_s(k * step_s)
        return self._known[k]
