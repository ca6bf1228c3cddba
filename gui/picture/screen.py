"""A frame on the screen: its numbers as a photograph or as they are, and whether its exposure suits it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.detector.transfer import decode_numbers
from flyaround.simulator.imaging.display import display_picture, raw_picture
from flyaround.simulator.imaging.image_formation import noise_sigma

if TYPE_CHECKING:
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.runtime.arrays import ByteArray

BURNT_SHARE = 0.3
"""A picture with more of its pixels at full scale is burnt out."""
BRIGHTEST, DARK, NOISE_SIGMAS = 0.998, 0.05, 3.0
"""A picture is dark if this share of its pixels is below so much of full scale and so many sigmas of the noise."""


def screen_picture(frame: Frame, *, raw: bool = False) -> ByteArray:
    """Return a frame's image as a screen shows it, or the upper eight bits of its numbers as they are."""
    sensor = frame.scene.sensor
    if raw:
        return raw_picture(frame.image, sensor.bits)
    return display_picture(frame.image, sensor, frame.scene.camera.pixel_encoding)


def exposure_fault(frame: Frame) -> str:
    """Return what is wrong with a picture's exposure, and what to do, in a sentence; empty if nothing is."""
    scene = frame.scene
    few = frame.image[::8, ::8]
    numbers, sensor = decode_numbers(few, scene.sensor, scene.camera.pixel_encoding)
    full, black = sensor.scale_dn
    light = (numbers.reshape(len(few), few.shape[1], -1).max(axis=2).astype(float) - black) / full
    if float(np.mean(light >= 0.999)) > BURNT_SHARE:
        return f"burnt out at {1e3 * scene.exposure_s:.3g} ms: Expose by the meter (Picture) shortens it"
    if float(np.quantile(light, BRIGHTEST)) > DARK + NOISE_SIGMAS * noise_sigma(scene.sensor):
        return ""
    if scene.sun_visible_fraction == 0:
        return f"dark: in the shadow of the Earth at {1e3 * scene.exposure_s:.3g} ms"
    return f"dark at {1e3 * scene.exposure_s:.3g} ms: Expose by the meter (Picture) lengthens it"
