"""Conversion of a frame for the screen, developed or raw, and a check of its exposure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.gui.picture.view_settings import exposure_text
from flyaround.simulator.camera.detector.transfer import decode_numbers
from flyaround.simulator.imaging.display import display_picture, raw_picture
from flyaround.simulator.imaging.image_formation import noise_sigma

if TYPE_CHECKING:
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray

SQUARE_PX = 8
BURNT, BURNT_SHARE = 0.99, 0.3
"""Signal from which a block counts as saturated, and share of such blocks above which a picture is overexposed."""
BRIGHTEST, DARK = 0.9995, 0.03
"""A picture is dark if this quantile of its blocks' signals is below ``DARK`` plus one sigma of the noise."""


def screen_picture(frame: Frame, *, raw: bool = False) -> ByteArray:
    """Return a frame's image for the screen.

    Returns
    -------
    array
        (H, W) or (H, W, 3) image, eight bits: developed, or with ``raw`` the upper eight bits of the digital numbers.
    """
    sensor = frame.scene.sensor
    if raw:
        return raw_picture(frame.image, sensor.bits)
    return display_picture(frame.image, sensor, frame.scene.camera.pixel_encoding)


def block_signals(frame: Frame) -> FloatArray:
    """Return the signals of a picture's blocks, each the mean of `SQUARE_PX` x `SQUARE_PX` pixels.

    Returns
    -------
    FloatArray
        (H, W) shares of full scale above the black level, of the brightest band.
    """
    scene, image = frame.scene, frame.image
    # means of 8 x 8 pixels reduce the noise, but keep a craft of a few blocks
    size = (max(image.shape[1] // SQUARE_PX, 1), max(image.shape[0] // SQUARE_PX, 1))
    means = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    blocks = means.astype(image.dtype, copy=False)
    numbers, sensor = decode_numbers(blocks, scene.sensor, scene.camera.pixel_encoding)
    full, black = sensor.scale_dn
    return (numbers.reshape(size[1], size[0], -1).max(axis=2).astype(float) - black) / full


def exposure_fault(frame: Frame) -> str:
    """Return a sentence on over- or underexposure of a picture with its remedy; empty if the exposure is right."""
    scene, light = frame.scene, block_signals(frame)
    exposure = exposure_text(scene.exposure_s)
    if float(np.mean(light >= BURNT)) > BURNT_SHARE:
        return f"burnt out at {exposure}: Expose by the meter"
    if float(np.quantile(light, BRIGHTEST)) > DARK + noise_sigma(scene.sensor):
        return ""
    if scene.sun_visible_fraction == 0:
        return f"dark: in the shadow of the Earth at {exposure}"
    return f"dark at {exposure}: Expose by the meter"
