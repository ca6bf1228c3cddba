"""The lens: stray light of the Sun, and the wings of its point spread function."""

import numpy as np
import pytest

from simulator.camera.model import Camera
from simulator.camera.optics import Optics
from simulator.camera.psf import psf_kernel
from simulator.camera.sensor import Sensor
from simulator.camera.shading import veiling_glare


def test_glare_follows_its_law_round_the_sun_and_is_never_dark():
    camera = Camera(width_px=480, height_px=360, fx_px=560.0, fy_px=560.0, cx_px=239.5, cy_px=179.5)
    for towards in ((0.2, -0.18, 1.0), (0.52, 0.0, 1.0)):
        sun = np.array(towards) / np.linalg.norm(towards)
        glare = veiling_glare(camera, Optics(veiling_glare_sr=0.02), sun, np.array([600.0]))
        assert glare.min() > 0
        x, y = np.meshgrid(np.arange(480), np.arange(360))
        angle_deg = np.degrees(np.arccos(np.clip(camera.rays(np.stack([x, y], -1)) @ sun, -1, 1)))
        assert glare == pytest.approx(0.02 * 600 / np.maximum(angle_deg, 0.3) ** 2, rel=3e-3)


def test_the_wings_of_a_diffraction_pattern_fade_in_a_circle():
    optics = Optics(psf="airy", f_number=8.0)
    sensor = Sensor(preset="t", blur_sigma_px=0.0, pixel_pitch_x_m=3.45e-6, pixel_pitch_y_m=3.45e-6)
    kernel = psf_kernel(optics, sensor, 0.0)
    y, x = np.mgrid[-31:32, -31:32]
    assert kernel.shape == x.shape
    # a hundred thousand times the full scale on one pixel leaves no edge at the kernel's own
    assert kernel[np.hypot(x, y) > 31.5].max() == 0
    assert kernel[:, 0].max() < 5e-7
    # diffraction: two wavelengths f-numbers over pi^2 and the radius of the light lie beyond it
    core = kernel[np.hypot(x, y) < 8].sum()
    assert 1 - core == pytest.approx(2 * 550e-9 * 8 / 3.45e-6 / np.pi**2 / 8, rel=0.4)
