"""Measurement of the modulation transfer function from a computed or rendered slanted edge, after ISO 12233."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.psf import applied_mtf, optics_mtf
from flyaround.simulator.camera.detector.sensor import Sensor
from flyaround.simulator.imaging.image_formation import expose
from flyaround.simulator.targets.model import Material
from tools.validation.bare_scene import bare_scene, bare_target, flat_plate, square_camera

if TYPE_CHECKING:
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.state import Quality

SIZE = 256  # side of the image [px]
SLANT = np.tan(np.radians(5.0))  # of the edge, as ISO 12233 proposes
BINS = 8  # sub-pixel bins of the edge profile
FREQUENCIES = np.arange(0.05, 0.46, 0.05)  # cycles per pixel
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
    """Return a bright half plane whose edge is inclined by 5 degrees; each pixel is its covered share."""
    fine = 64
    y = np.arange(SIZE)[:, None] + ((np.arange(fine) + 0.5) / fine - 0.5)
    # (H, fine): position at which the edge crosses each fine row
    position = SIZE / 2 + SLANT * (y - SIZE / 2)
    x = np.arange(SIZE)
    return np.clip(x[None, :, None] + 0.5 - position[:, None, :], 0, 1).mean(axis=2)


def drawn_edge(renderer: Renderer, quality: Quality = "high") -> FloatArray:
    """Return the rendering of the same half plane: a sunlit plate that covers the image to the right of the edge."""
    z_m, focal_px = 10.0, 2.0 * SIZE
    far = SIZE * z_m / focal_px
    plate = flat_plate("plate", (0.0, far), (-far, far), 0.0)
    target = bare_target([plate], [Material(name="m", base_color=(0.5, 0.5, 0.5), roughness=1.0)])
    # pixel (SIZE / 2, SIZE / 2) is half a pixel off the axis
    middle = 0.5 * z_m / focal_px
    turn = -np.arctan(SLANT)
    scene = bare_scene(
        target, square_camera(SIZE, focal_px), (middle, middle, z_m), (0.0, 0.0, turn), quality=quality
    )
    return np.asarray(renderer.render(scene, target).radiance, float)


def measured_mtf(image: FloatArray, frequency: FloatArray) -> FloatArray:
    """Return the MTF across a nearly vertical edge at frequencies [cycles per pixel], including the pixel's MTF.

    The edge is detected in the image: a straight line through the centroids of each row's gradient.

    References
    ----------
    ISO 12233:2017, Electronic still image imaging: resolution and spatial frequency responses, annex C.
    """
    height, width = image.shape
    slope = np.abs(np.diff(image, axis=1))
    position_px = np.arange(width - 1) + 0.5
    start = np.median((slope @ position_px) / slope.sum(axis=1))
    rows = np.arange(16, height - 16)
    line = np.array([0.0, start])
    for _ in range(3):
        # pixels far from the edge are excluded from the centroid
        near = np.abs(position_px - np.polyval(line, rows)[:, None]) < (
            height * SLANT if line[0] == 0 else 12
        )
        weight = slope[rows] * near
        line = np.polyfit(rows, (weight @ position_px) / weight.sum(axis=1), 1)
    y, x = np.mgrid[:height, :width]
    distance = (x - np.polyval(line, y)) / np.hypot(1, line[0])
    inside = (np.abs(distance) < width / 4) & (y >= rows[0]) & (y <= rows[-1])
    index = np.floor(distance[inside] * BINS).astype(int)
    index -= index.min()
    count = np.bincount(index)
    spread = np.bincount(index, image[inside]) / np.maximum(count, 1)
    spike = np.diff(spread[count > 0])
    spike *= np.hanning(len(spike) + 2)[1:-1]
    offset_px = (np.arange(len(spike)) - np.argmax(np.abs(spike))) / BINS
    transfer = np.abs(np.exp(-2j * np.pi * np.outer(frequency, offset_px)) @ spike)
    # compensate for the attenuation by the bins and by their difference
    transfer /= np.abs(spike.sum()) * np.sinc(frequency / BINS) ** 2
    return np.asarray(transfer)


def compare(case: str, picture: FloatArray | None = None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the measured MTF, the product of optics' and pixel's MTF, and that of the applied blur's and pixel's MTF.

    Parameters
    ----------
    case : str
        Sensor and optics, a key of ``CASES``.
    picture : array, optional
        Image of the edge; by default computed.
    """
    sensor, optics = CASES[case]
    sharp = edge() if picture is None else picture
    image = expose((sharp / sharp.max()).astype(np.float32), sensor, 1.0, 1.0, optics)
    measured = measured_mtf(image.astype(float), FREQUENCIES)
    # across the edge: nearly along x
    angle = np.arctan(SLANT)
    fx, fy = FREQUENCIES * np.cos(angle), -FREQUENCIES * np.sin(angle)
    pixel = np.sinc(fx) * np.sinc(fy)
    used = applied_mtf(fx, fy, optics, sensor)
    ideal = used if optics.psf == "kernel" else optics_mtf(fx, fy, optics, sensor)
    return measured, ideal * pixel, used * pixel
