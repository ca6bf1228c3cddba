"""Measures the modulation transfer function from a drawn slanted edge, after ISO 12233."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from simulator.camera.develop import expose
from simulator.camera.optics import Optics
from simulator.camera.psf import optics_mtf, psf_kernel
from simulator.camera.sensor import Sensor

if TYPE_CHECKING:
    from simulator.arrays import FloatArray

SIZE = 256
SLANT = np.tan(np.radians(5.0))
BINS = 8
FREQUENCIES = np.arange(0.05, 0.46, 0.05)
_BLANK = Sensor(preset="mtf", full_scale_j_m2_sr=1.0, blur_sigma_px=0.0)
CASES: dict[str, tuple[Sensor, Optics]] = {
    "speed: Gaussian, 1 px": (replace(_BLANK, blur_sigma_px=1.0), Optics()),
    "Gaussian, 0.75 px": (_BLANK, Optics(psf="gaussian", psf_sigma_px=0.75)),
    "Airy f/8 on 3.45 um, 0.45 px of aberrations": (
        replace(_BLANK, pixel_pitch_x_m=3.45e-6, pixel_pitch_y_m=3.45e-6),
        Optics(psf="airy", f_number=8.0, psf_sigma_px=0.45),
    ),
    "measured kernel, 3 x 3": (
        _BLANK,
        Optics(psf="kernel", kernel=((0.05, 0.10, 0.05), (0.10, 0.40, 0.10), (0.05, 0.10, 0.05))),
    ),
}


def edge() -> FloatArray:
    """A bright half plane whose edge is 5 degrees off the columns: each pixel holds the share that it covers."""
    fine = 64
    y = np.arange(SIZE)[:, None] + ((np.arange(fine) + 0.5) / fine - 0.5)
    position = SIZE / 2 + SLANT * (y - SIZE / 2)  # (H, fine): where the edge crosses each fine row
    x = np.arange(SIZE)
    return np.clip(x[None, :, None] + 0.5 - position[:, None, :], 0, 1).mean(axis=2)


def measured_mtf(image: FloatArray, frequency: FloatArray) -> FloatArray:
    """MTF across the slanted edge at frequencies [cycles per pixel]; the pixel's own is in it."""
    rows, columns = np.mgrid[:SIZE, :SIZE]
    # distance from the edge, across it
    distance = (columns - SIZE / 2 - SLANT * (rows - SIZE / 2)) / np.hypot(1, SLANT)
    inside = (np.abs(distance) < SIZE / 4) & (rows > 16) & (rows < SIZE - 16)
    index = np.floor(distance[inside] * BINS).astype(int)
    index -= index.min()
    count = np.bincount(index)
    spread = np.bincount(index, image[inside]) / np.maximum(count, 1)
    line = np.diff(spread[count > 0])
    line *= np.hanning(len(line) + 2)[1:-1]
    at = (np.arange(len(line)) - np.argmax(line)) / BINS
    transfer = np.abs(np.exp(-2j * np.pi * np.outer(frequency, at)) @ line)
    # what the bins and their difference take off
    transfer /= line.sum() * np.sinc(frequency / BINS) ** 2
    return np.asarray(transfer)


def compare(case: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """MTF measured, MTF of the optics times the pixel, and MTF of the kernel used times the pixel."""
    sensor, optics = CASES[case]
    image = expose(edge().astype(np.float32), sensor, 1.0, 1.0, optics)
    found = measured_mtf(image.astype(float), FREQUENCIES)
    # across the edge: nearly along x
    angle = np.arctan(SLANT)
    fx, fy = FREQUENCIES * np.cos(angle), -FREQUENCIES * np.sin(angle)
    pixel = np.sinc(fx) * np.sinc(fy)
    kernel = psf_kernel(optics, sensor, 0.0)
    if kernel is None:
        used = optics_mtf(fx, fy, optics, sensor)
    else:
        half = [n // 2 for n in kernel.shape]
        y, x = np.mgrid[-half[0] : half[0] + 1, -half[1] : half[1] + 1]
        phase = np.exp(-2j * np.pi * (fx[:, None, None] * x + fy[:, None, None] * y))
        used = np.abs((phase * kernel).sum(axis=(1, 2)))
    ideal = used if optics.psf == "kernel" else optics_mtf(fx, fy, optics, sensor)
    return found, ideal * pixel, used * pixel
