"""Check of the image-dependent keypoint states (visible, saturated, below_noise) from the noise-free clean twin."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.detector.response import SRGB_FROM_BANDS
from flyaround.simulator.camera.detector.transfer import decode_numbers
from flyaround.simulator.camera.encoding import step_share
from flyaround.simulator.dataset.check.feasibility import check_step_share
from flyaround.simulator.imaging.image_formation import noise_sigma
from flyaround.simulator.labels.keypoints import CONTRAST_RADIUS_PX

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.labels.truth import Truth
    from flyaround.simulator.targets.model import Target

BY_SIGNAL = ("visible", "saturated", "below_noise")

RELATIVE = 0.02
"""Relative tolerance of the contrast at the noise level, within which either state is accepted."""

MEAN_OF_SRGB = np.full(3, 1 / 3) @ np.linalg.inv(SRGB_FROM_BANDS)
"""Weights of the linear sRGB channels that give the mean of the detector's bands."""


def check_states_by_signal(truth: Truth, clean: NDArray[np.unsignedinteger]) -> list[str]:
    """Return faults for keypoints whose visible, saturated or below-noise state contradicts the noise-free image.

    The image is quantised, so the signal is known to half a quantisation step only; if two states are possible, either
    is accepted. Colours that saturate in a single band are not checked, nor are detectors with blooming or with a
    colour filter mosaic.
    """
    signal = _signal(truth, clean)
    if signal is None:
        return []
    faults = []
    for k in truth.keypoints:
        if k.state not in BY_SIGNAL or k.pixel_px is None:
            continue
        u, v = (int(x) for x in np.rint(k.pixel_px))
        r = CONTRAST_RADIUS_PX
        patch = signal[max(v - r, 0) : v + r + 1, max(u - r, 0) : u + r + 1]
        possible = _possible_states(truth, patch, _step(truth, patch))
        if k.state not in possible:
            faults.append(
                f"keypoint {k.name} is labelled {k.state}, the clean twin says {' or '.join(possible)}"
            )
    return faults


def check_steps_by_signal(truth: Truth, target: Target, clean: NDArray[np.unsignedinteger]) -> list[str]:
    """Check ``wireframe_step_share`` against the clean twin; without faults if the signal is not known from it."""
    signal = _signal(truth, clean)
    if signal is None or _is_matrixed(truth, signal):
        return []  # colours outside the sRGB gamut were clipped, so their signal is unknown
    mono = signal if signal.ndim == 2 else signal.mean(axis=2)
    return check_step_share(truth, target, mono, 0.51 * _step(truth, mono))


def _signal(truth: Truth, clean: NDArray[np.unsignedinteger]) -> NDArray[np.float64] | None:
    """Return the signal of the clean twin, 1 at full scale; ``None`` if its numbers mix signals of several pixels."""
    detector = truth.scene.sensor.detector
    if detector is not None and (detector.blooming > 0 or clean.ndim == 3 or truth.scene.bands == "rgb"):
        return None
    numbers, sensor = decode_numbers(clean, truth.scene.sensor, truth.camera.pixel_encoding)
    full, black = sensor.scale_dn
    return (numbers.astype(float) - black) / full


def _is_matrixed(truth: Truth, signal: NDArray[np.float64]) -> bool:
    """Return True if a colour matrix converted the detector's bands to the image's primaries."""
    return signal.ndim == 3 and truth.camera.pixel_encoding == "srgb"


def _step(truth: Truth, signal: NDArray[np.float64]) -> float:
    """Return the largest quantisation step of the image at its signal, relative to full scale."""
    encoding = truth.camera.pixel_encoding
    if encoding == "linear":
        return 1.0 / truth.scene.sensor.scale_dn[0]
    return float(step_share(signal.max(initial=0), encoding))


def _possible_states(truth: Truth, signal: NDArray[np.float64], step: float) -> tuple[str, ...]:
    """Return the possible states of a patch (h, w) or (h, w, 3) of the signal, known to half a ``step``."""
    # half a step is rounded up; the hundredth allows for rounding
    at_full = signal >= 1 - 0.51 * step
    if at_full.all():
        return ("saturated", "below_noise")  # a signal half a step below full scale is rounded to full scale
    if signal.ndim == 3:
        matrixed = _is_matrixed(truth, signal)
        if at_full.any() or (matrixed and signal.min() <= 0):
            return BY_SIGNAL
        weights = MEAN_OF_SRGB if matrixed else np.full(3, 1 / 3)
        signal, step = signal @ weights, step * float(np.abs(weights).sum())
    clipped = np.clip(signal, 0, 1)
    contrast = float(clipped.max() - clipped.min())
    sigma = noise_sigma(truth.scene.sensor, float(clipped.mean()), truth.scene.exposure_s)
    slack = step + RELATIVE * sigma
    return tuple(
        state
        for state, fits in (
            ("visible", contrast > sigma - slack),
            ("below_noise", contrast < sigma + slack),
        )
        if fits
    )
