"""A frame on the screen: its numbers as a photograph or as they are, and whether its exposure suits it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.detector.transfer import decode_numbers
from flyaround.simulator.imaging.display import display_picture, raw_picture
from flyaround.simulator.imaging.image_formation import noise_sigma

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.frame import Frame
    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray

BURNT_SHARE = 0.3
"""A picture with more of its pixels at full scale is burnt out."""
BRIGHTEST, DARK, NOISE_SIGMAS = 0.98, 0.03, 2.0
"""A picture is dark if this share of its pixels is below so much of full scale and so many sigmas of the noise."""
MOST_PIXELS = 20_000
"""Of the craft's that are judged."""


def screen_picture(frame: Frame, *, raw: bool = False) -> ByteArray:
    """Return a frame's image as a screen shows it, or the upper eight bits of its numbers as they are."""
    sensor = frame.scene.sensor
    if raw:
        return raw_picture(frame.image, sensor.bits)
    return display_picture(frame.image, sensor, frame.scene.camera.pixel_encoding)


def exposure_fault(frame: Frame) -> str:
    """Return what is wrong with a picture's exposure, and what to do, in a sentence; empty if nothing is.

    A picture is judged whole, and dark only if the craft in it is, too: a small one may be all that is lit.
    """
    scene, whole = frame.scene, _light(frame, frame.image[::8, ::8])
    if float(np.mean(whole >= 0.999)) > BURNT_SHARE:
        return f"burnt out at {1e3 * scene.exposure_s:.3g} ms: Expose by the meter (Picture) shortens it"
    parts = [whole]
    if frame.truth is not None and frame.truth.box_px is not None:
        x0, y0, x1, y1 = (round(v + 0.5) for v in frame.truth.box_px)
        step = max(int(np.sqrt((x1 - x0) * (y1 - y0) / MOST_PIXELS)), 1)
        parts.append(_light(frame, frame.image[y0:y1:step, x0:x1:step]))
    least = DARK + NOISE_SIGMAS * noise_sigma(scene.sensor)
    if any(float(np.quantile(light, BRIGHTEST)) > least for light in parts if light.size):
        return ""
    if scene.sun_visible_fraction == 0:
        return f"dark: in the shadow of the Earth at {1e3 * scene.exposure_s:.3g} ms"
    return f"dark at {1e3 * scene.exposure_s:.3g} ms: Expose by the meter (Picture) lengthens it"


def _light(frame: Frame, part: NDArray[np.unsignedinteger]) -> FloatArray:
    """Return light of pixels, the brightest of their bands, 1 at full scale."""
    numbers, sensor = decode_numbers(part, frame.scene.sensor, frame.scene.camera.pixel_encoding)
    full, black = sensor.scale_dn
    return (numbers.reshape(*part.shape[:2], -1).max(axis=2, initial=0).astype(float) - black) / full
