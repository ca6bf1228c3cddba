"""Share of the target that is saturated or dark in the frames of a capture, and a suitable exposure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.imaging.image_formation import expose
from flyaround.simulator.scene.illumination.bands import sunlight_balance

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.frame import Frame

NOTABLE_SHARE = 0.05
"""Share of saturated target pixels above which an exposure is proposed."""

# a frame is dark if the proposed exposure is longer by this factor: four fifths of the scale are unused
_DARK = 5.0

# Highlights may saturate: the brightest fiftieth of the target's pixels; the rest should stay below this signal.
_UNCLIPPED_SHARE, _TARGET_SIGNAL = 0.98, 0.9

# Ratio of the frames' exposures above which no single exposure suits all.
_MAX_EXPOSURE_RATIO = 4.0


@dataclass(frozen=True)
class Clipping:
    """Saturated pixels of one frame.

    Parameters
    ----------
    target_px : int
        Number of pixels on the target.
    clipped_px : int
        Number of those whose noise-free signal is at full scale.
    exposure_s : float
        Exposure of the frame.
    fitting_s : float
        Exposure at which all but the brightest 2 % of the target stay below full scale; 0 if it is unlit.
    """

    target_px: int
    clipped_px: int
    exposure_s: float
    fitting_s: float

    @property
    def is_dark(self) -> bool:
        """True if a longer exposure would help; an unlit target is dark at any exposure."""
        return self.fitting_s > _DARK * self.exposure_s


@dataclass(frozen=True)
class ClippingSummary:
    """Saturated pixels of a capture.

    Parameters
    ----------
    share : float
        Saturated share of the target's pixels, over all frames.
    worst_share : float
        Saturated share of the target's pixels, in the worst frame.
    advice : str
        Remedy for saturation or darkness; empty if neither is notable.
    dark_frames : int, optional
        Number of frames in which the lit target uses little of the scale.
    """

    share: float
    worst_share: float
    advice: str
    dark_frames: int = 0


def measure_clipping(frame: Frame) -> Clipping:
    """Measure the saturated pixels of a labelled frame from its radiance, without noise.

    Returns
    -------
    Clipping
        Numbers of pixels and the exposure that fits; zeros but for the frame's exposure if no pixel is on the target.
    """
    scene = frame.scene
    radiance = frame.radiance[frame.mask > 0] if frame.mask is not None else frame.radiance[:0].ravel()
    if not len(radiance):
        return Clipping(0, 0, scene.exposure_s, 0.0)
    # a uniform image of unit radiance, exposed for a second, gives the scale of each band
    uniform = np.ones((9, 9, *radiance.shape[1:]), np.float32)
    scale = expose(uniform, scene.sensor, 1.0, sunlight_balance(scene.bands), scene.optics)[4, 4]
    signal_1s = radiance * scale
    # a colour pixel saturates with its first band
    brightest = signal_1s if signal_1s.ndim == 1 else signal_1s.max(axis=1)
    clipped = int(np.count_nonzero(brightest * scene.exposure_s >= 1.0))
    high = float(np.quantile(brightest, _UNCLIPPED_SHARE))
    return Clipping(len(brightest), clipped, scene.exposure_s, _TARGET_SIGNAL / high if high > 0 else 0.0)


def summarise_clipping(frames: Sequence[Clipping], document: dict[str, Any]) -> ClippingSummary | None:
    """Summarise the clipping of several frames; None if none shows a target.

    Parameters
    ----------
    frames : sequence of Clipping
        Clipping of each frame.
    document : dict
        Their scenario or recipe, for the advice.

    Returns
    -------
    ClippingSummary or None
        Saturated shares of the target's pixels, number of dark frames, and a remedy.
    """
    with_target = [f for f in frames if f.target_px]
    if not with_target:
        return None
    share = sum(f.clipped_px for f in with_target) / sum(f.target_px for f in with_target)
    worst = max(f.clipped_px / f.target_px for f in with_target)
    dark = [f for f in with_target if f.is_dark]
    advice = ""
    if share > NOTABLE_SHARE:
        advice = _advice(with_target, document)
    elif 2 * len(dark) > len(with_target):
        advice = _advice(dark, document)
    return ClippingSummary(share, worst, advice, len(dark))


def _advice(frames: Sequence[Clipping], document: dict[str, Any]) -> str:
    if document.get("schema") != "flyaround.scenario":
        return (
            "the recipe sets the exposure, for the target it was made for; --auto-exposure follows the light"
        )
    sensor = document.get("sensor") or {}
    if sensor.get("auto_exposure") is not None:
        level = sensor["auto_exposure"].get("level", 0.5)
        comparison = "above" if frames[0].is_dark else "below"
        return f"set level {comparison} {level:g} in [sensor.auto_exposure], or its lag_s shorter"
    fitting = [f.fitting_s for f in frames if f.fitting_s > 0]
    best, longest = min(fitting), max(fitting)
    number = f"exposure_s = {_two_digits(best)} in [sensor] (here {frames[0].exposure_s:g})"
    if longest > _MAX_EXPOSURE_RATIO * best:
        return (
            f"add [sensor.auto_exposure], because the frames need {_two_digits(best)} to {_two_digits(longest)} s; or, "
            f"for the brightest, {number}"
        )
    return f"set {number}, or add [sensor.auto_exposure] (--auto-exposure), which follows the light"


def _two_digits(x: float) -> str:
    """Round down to two digits: a proposed exposure must not saturate."""
    step = 10.0 ** (np.floor(np.log10(x)) - 1)
    return f"{np.floor(x / step * (1 + 1e-9)) * step:.2g}"
