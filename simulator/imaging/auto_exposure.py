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

# Steps of the exposure filter per time constant: two follow a change within half of the lag, each costs a metering.
STEPS_PER_LAG = 2

# Share of a step by which rounding may place a time before the step that it begins.
STEP_TOLERANCE = 1e-9

MEMORY_LAGS = 12
"""Lags after which earlier values have decayed below 1e-5 and are ignored."""


class AutoExposure(Section, frozen=True, kw_only=True):
    """Automatic exposure that follows the scene with lag, in place of ``exposure_s``.

    ``level``: signal, 1 at full scale, that a ``share`` of the lit image area stays below.
    """

    level: Annotated[float, Meta(gt=0, le=1)] = 0.5
    share: Annotated[float, Meta(gt=0, le=1)] = 0.9
    # time constant of the logarithm of the exposure
    lag_s: Annotated[float, Meta(ge=0.01, le=600)] = 2.0
    # limits; if nothing is lit, the longest is used
    shortest_s: Annotated[float, within(EXPOSURE_S)] = 1e-5
    longest_s: Annotated[float, within(EXPOSURE_S)] = 0.1

    def exposure_for_radiance_s(self, radiance_w_m2_sr: float, full_scale_j_m2_sr: float) -> float:
        """Return the exposure that brings a radiance to the level [s].

        Parameters
        ----------
        radiance_w_m2_sr : float
            Radiance to expose for.
        full_scale_j_m2_sr : float
            Radiance times exposure at full scale.

        Returns
        -------
        float
            Exposure within the bounds [s].
        """
        if radiance_w_m2_sr <= 0:
            return self.longest_s
        exposure_s = self.level * full_scale_j_m2_sr / radiance_w_m2_sr
        return float(np.clip(exposure_s, self.shortest_s, self.longest_s))


@dataclass(frozen=True, eq=False)
class ExposureTrack:
    """The exposure along a flight: a low-pass filter of the metered exposure at fixed times.

    The meter is sampled every ``lag_s / 2`` from the flight's start. The exposure at a time depends on the samples of
    the preceding twelve lags only, not on the frames that are drawn.

    Parameters
    ----------
    settings : AutoExposure
        Limits, level and time constant of the control.
    metered_exposure_s : callable
        Function from a time since the flight's start [s] to the metered exposure [s].
    """

    settings: AutoExposure
    metered_exposure_s: Callable[[float], float]
    _cache: dict[int, float] = field(default_factory=dict)

    def exposure_s(self, t_s: float) -> float:
        """Return the exposure at ``t_s``.

        Returns
        -------
        float
            Exposure [s]. At the flight's start it is the metered one, because the loop is settled then.
        """
        step = self.settings.lag_s / STEPS_PER_LAG
        step_index = int(np.floor(t_s / step + STEP_TOLERANCE))
        first = max(0, step_index - STEPS_PER_LAG * MEMORY_LAGS)
        log = np.log(self._metered_s(first, step))
        for k in range(first, step_index + 1):
            span = step if k < step_index else t_s - step_index * step
            target = np.log(self._metered_s(k, step))
            log = target + (log - target) * np.exp(-max(span, 0.0) / self.settings.lag_s)
        return float(np.exp(log))

    def _metered_s(self, k: int, step_s: float) -> float:
        if k not in self._cache:
            self._cache[k] = self.metered_exposure_s(k * step_s)
        return self._cache[k]
