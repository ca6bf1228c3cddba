"""Measurement of the simulated detector by EMVA 1288, from its digital numbers alone.

References
----------
EMVA (2016), Standard 1288, Standard for characterization of image sensors and cameras, release 3.1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.detector.readout import detect
from flyaround.simulator.camera.detector.response import white_balance
from flyaround.simulator.scene.illumination.bands import sunlight_balance

if TYPE_CHECKING:
    from flyaround.simulator.camera.detector.sensor import Detector, Sensor
    from flyaround.simulator.runtime.arrays import FloatArray

SHAPE = (600, 800)  # size of an image [px]
FRAMES = 40  # number of images for spatial variances


@dataclass(frozen=True)
class Measured:
    """A measured quantity: its name and unit, the true parameter of the detector, and the measurement."""

    name: str
    given: float
    found: float

    @property
    def error(self) -> float:
        """Relative error."""
        return self.found / self.given - 1


def measure(name: str, *, seed: int = 5) -> list[Measured]:
    """Return the gain, read noise, PRNU, DSNU and dark current of a built-in detector."""
    base = sensor_preset(name)
    detector = _detector(base)
    # the standard excludes defect pixels
    sensor = replace(
        base, detector=replace(detector, hot_pixel_share=0.0, dead_pixel_share=0.0, column_noise_e=0.0)
    )
    d = _detector(sensor)
    gain_dn_e, read_noise_e = photon_transfer(sensor, seed)
    half, dark = (_stack(sensor, share, 0.0, seed + k) for k, share in enumerate((0.5, 0.0)))
    # section 8.1: spatial variances of the mean images, minus the remaining temporal noise
    s2_half, s2_dark = (spatial - temporal / FRAMES for spatial, temporal in (half[1:], dark[1:]))
    prnu = np.sqrt(s2_half - s2_dark) / (half[0] - dark[0])
    dsnu_e = np.sqrt(max(s2_dark, 0.0)) / gain_dn_e
    # section 7: slope of the dark signal over the exposure time
    times = np.array([0.1, 0.4, 0.7, 1.0])
    level = [
        detect(np.zeros(SHAPE, np.float32), sensor, seed, 900 + k, t).mean() for k, t in enumerate(times)
    ]
    dark_e_s = np.polyfit(times, level, 1)[0] / gain_dn_e
    return [
        Measured("system gain [DN/e]", 1 / d.gain_e_per_dn, gain_dn_e),
        Measured("read noise [e]", d.read_noise_e, read_noise_e),
        Measured("PRNU [%]", 100 * d.prnu, 100 * prnu),
        Measured("DSNU [e]", d.dsnu_e, dsnu_e),
        Measured("dark current [e/s]", d.dark_e_s, dark_e_s),
    ]


def without_nonuniformity(sensor: Sensor) -> Sensor:
    """Return the sensor with identical pixels and lines, with photon noise and read noise of the pixels only."""
    d = replace(
        _detector(sensor),
        prnu=0.0,
        dsnu_e=0.0,
        dark_current_e_s=0.0,
        hot_pixel_share=0.0,
        dead_pixel_share=0.0,
        row_noise_e=0.0,
        column_noise_e=0.0,
    )
    return replace(sensor, detector=d)


def photon_transfer(sensor: Sensor, seed: int) -> tuple[float, float]:
    """Return the system gain [DN e-1] and read noise [e] from pairs of flat images (section 6.6 and 6.7).

    The temporal variance of a level is half the variance of a pair's difference. Its slope over the mean, up to 70 % of
    saturation, is the gain; its value in the dark is the read noise plus the quantisation variance of 1/12.
    """
    mean, variance = [], []
    for k, share in enumerate(np.linspace(0.0, 0.7, 15)):
        a, b = (_flat(sensor, share, seed, 2 * k + i) for i in (0, 1))
        mean.append((a.mean() + b.mean()) / 2)
        variance.append(np.mean((a - b) ** 2) / 2)
    signal, noise = np.array(mean) - mean[0], np.array(variance)
    gain = float((signal @ (noise - noise[0])) / (signal @ signal))
    return gain, float(np.sqrt(noise[0] - 1 / 12) / gain)


COLOUR_SHAPE, COLOUR_LEVELS = (240, 320), 40  # size of a colour image [px], and number of exposure levels
COLOURS = ("red", "green", "blue")
READOUT_MODES = ("raw mosaic", "three planes, white balanced", "interpolated mosaic, white balanced")


def measure_colours(name: str, *, mode: str, seed: int = 5, levels: int = COLOUR_LEVELS) -> list[Measured]:
    """Return the system gain of each channel of a built-in detector with a colour filter [DN e-1], from a white plate.

    The expected value is the converter's gain times the channel's white balance. Interpolated sums of neighbours have
    less noise than one pixel of the same mean, so for them the channel's mean divided by the raw pixels' electrons is
    measured, not the photon transfer.

    Parameters
    ----------
    name : str
        Preset of the detector.
    mode : str
        One of ``READOUT_MODES``.
    seed : int, optional
        Seed of the noise.
    levels : int, optional
        Number of brightness levels of the plate.
    """
    base = without_nonuniformity(sensor_preset(name))
    raw, planes = mode == READOUT_MODES[0], mode == READOUT_MODES[1]
    detector = replace(_detector(base), colour_filter="none" if planes else "rggb", demosaic=not raw)
    sensor = replace(base, detector=detector)
    sunlight = sunlight_balance("rgb")
    balance = np.ones(3) if raw else white_balance(sensor, Optics(), sunlight)
    # signal of the channels from a white plate in sunlight, the brightest at up to 70 % of saturation
    electrons = 1 / white_balance(sensor, Optics(), sunlight)
    shares = np.linspace(0, 0.7, levels)[:, None] * electrons / electrons.max()
    mean, variance = np.zeros((len(shares), 3)), np.zeros((len(shares), 3))
    for k, share in enumerate(shares):
        signal = np.broadcast_to(share.astype(np.float32), (*COLOUR_SHAPE, 3))
        a, b = (
            detect(signal, sensor, seed, 2 * k + i, 0.0, 1.0 if raw else balance).astype(float)
            for i in (0, 1)
        )
        for c in range(3):
            one, two = (_channel(image, c, raw=raw)[8:-8, 8:-8] for image in (a, b))
            mean[k, c], variance[k, c] = (one.mean() + two.mean()) / 2, np.mean((one - two) ** 2) / 2
    out = []
    for c, colour in enumerate(COLOURS):
        if mode == READOUT_MODES[2]:
            slope = float(np.polyfit(shares[:, c] * sensor.saturation_e, mean[:, c], 1)[0])
        else:
            # without the dark level, whose few digital numbers do not change with a factor near one
            slope = float(np.polyfit(mean[1:, c], variance[1:, c], 1)[0])
        out.append(Measured(f"{colour} [DN/e]", float(balance[c] / detector.gain_e_per_dn), slope))
    return out


def _channel(image: FloatArray, number: int, *, raw: bool) -> FloatArray:
    """Return one channel of a colour image, or of a raw RGGB mosaic."""
    if not raw:
        return image[..., number]
    y, x = ((0, 0), (0, 1), (1, 1))[number]
    return image[y::2, x::2]


def _flat(sensor: Sensor, share: float, seed: int, frame: int, exposure_s: float = 0.0) -> FloatArray:
    signal = np.full(SHAPE, share, np.float32)
    return detect(signal, sensor, seed, frame, exposure_s).astype(float)


def _stack(sensor: Sensor, share: float, exposure_s: float, seed: int) -> tuple[float, float, float]:
    """Return the mean level, spatial variance of the mean image, and temporal variance of an image [DN, DN2, DN2]."""
    total, squares = np.zeros(SHAPE), np.zeros(SHAPE)
    for k in range(FRAMES):
        image = _flat(sensor, share, seed, 100 + k, exposure_s)
        total += image
        squares += image**2
    mean = total / FRAMES
    temporal = float(np.mean((squares - total * mean) / (FRAMES - 1)))
    return float(mean.mean()), float(mean.var()), temporal


def _detector(sensor: Sensor) -> Detector:
    if sensor.detector is None:
        raise ValueError(f"sensor {sensor.preset} has no detector to measure")
    return sensor.detector
