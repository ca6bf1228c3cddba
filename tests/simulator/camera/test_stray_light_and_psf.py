"""Stray light of the Sun, and the wings of the point-spread function."""

import cv2
import numpy as np
import pytest

from flyaround.simulator.camera.detector import psf
from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.psf import applied_mtf, blur, optics_mtf, psf_kernel, psf_pyramid
from flyaround.simulator.camera.detector.psf_pyramid import fit_kernel, fit_pyramid
from flyaround.simulator.camera.detector.sensor import Sensor
from flyaround.simulator.camera.detector.shading import scatter, veiling_glare
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.imaging.image_formation import expose


def test_glare_follows_its_law_round_the_sun_and_is_never_dark():
    camera = Camera(width_px=480, height_px=360, fx_px=560.0, fy_px=560.0, cx_px=239.5, cy_px=179.5)
    for towards in ((0.2, -0.18, 1.0), (0.52, 0.0, 1.0)):
        sun = np.array(towards) / np.linalg.norm(towards)
        glare = veiling_glare(camera, Optics(veiling_glare_sr=0.02), sun, np.array([600.0]))
        assert glare.min() > 0
        x, y = np.meshgrid(np.arange(480), np.arange(360))
        angle_deg = np.degrees(np.arccos(np.clip(camera.rays(np.stack([x, y], -1)) @ sun, -1, 1)))
        assert np.abs(glare / (0.02 * 600 / np.maximum(angle_deg, 0.3) ** 2) - 1).max() < 3e-3


SQUARE = Sensor(preset="t", blur_sigma_px=0.0, pixel_pitch_x_m=5.86e-6, pixel_pitch_y_m=5.86e-6)


def point(optics, sensor=SQUARE, at=(100, 100), size=201, disc_px=0.0):
    """A point source through the lens."""
    light = np.zeros((size, size), np.float32)
    light[at] = 1.0
    return blur(light, optics, sensor, disc_px, 1.0)


@pytest.mark.parametrize("f_number", [4.0, 8.0, 16.0])
def test_the_wings_of_a_diffraction_pattern_fall_with_the_cube_of_the_radius(f_number):
    kernel = point(Optics(psf="airy", f_number=f_number, psf_sigma_px=0.5), at=(400, 400), size=801)
    y, x = np.mgrid[-400:401, -400:401]
    r = np.hypot(x, y)
    # the light of all rings beyond r: 2 wavelengths f-numbers / (pi^2 r), Born & Wolf (1999), section 8.5
    per_px = 550e-9 * f_number / 5.86e-6
    for inner, outer in ((20, 40), (40, 80), (80, 160), (160, 320)):
        share = kernel[(r >= inner) & (r < outer)].sum()
        assert share == pytest.approx(2 * per_px / np.pi**2 * (1 / inner - 1 / outer), rel=0.2)
    # the Sun's disc is ten million times the scale: what is negative would be black, and what it saturates is round
    assert kernel.min() >= 0
    ring = kernel[(r > 148) & (r < 152)]
    assert ring.std() < 0.1 * ring.mean()


@pytest.mark.parametrize("at", [(400, 400), (403, 398)])
def test_scattered_light_falls_with_a_power_of_the_distance_and_none_is_lost(at):
    light = np.zeros((801, 801), np.float32)
    light[at] = 1.0
    seen = scatter(light, Optics(scatter_share=0.02)).astype(float)
    assert seen.sum() == pytest.approx(1.0, abs=1e-4)
    assert seen[at] == pytest.approx(0.98, abs=0.002)
    y, x = np.mgrid[:801, :801]
    r = np.hypot(y - at[0], x - at[1])
    rings = [seen[np.abs(r - reach) < 0.5] for reach in (5.0, 20.0, 80.0, 160.0)]
    falls = np.diff(np.log([ring.mean() for ring in rings])) / np.diff(np.log([5.0, 20.0, 80.0, 160.0]))
    assert falls == pytest.approx(-2.5, abs=0.3)
    assert max(ring.std() / ring.mean() for ring in rings) < 0.15
    assert scatter(light, Optics()) is light


def test_a_pyramid_keeps_the_light_and_the_place_of_a_point_wherever_it_lies():
    # as wide as two levels down, no further: all of it is in the picture
    pyramid = fit_pyramid(
        lambda fx, fy: np.exp(-2 * (np.pi * 3.0) ** 2 * (fx**2 + fy**2)), swap_symmetric=True
    )
    y, x = np.mgrid[:301, :301]
    for at in ((150, 150), (151, 150), (149, 153), (146, 145)):
        light = np.zeros((301, 301), np.float32)
        light[at] = 1.0
        image = pyramid.blur(light, 1.0).astype(float)
        assert image.sum() == pytest.approx(1, abs=1e-6)
        assert ((image * y).sum(), (image * x).sum()) == pytest.approx(at, abs=1e-4)
        assert (image * (x - at[1]) ** 2).sum() == pytest.approx(9, rel=0.05)
    optics = Optics(psf="airy", f_number=8.0, psf_sigma_px=0.5)
    flat = np.ones((77, 101, 3), np.float32)
    assert np.abs(blur(flat, optics, SQUARE, 0.0, 2.0) - 2.0).max() < 1e-5


def test_pyramid_blur_matches_its_declared_psf():
    optics = Optics(psf="airy", f_number=11.0, psf_sigma_px=0.5)
    images = [point(optics, at=(100 + i % 4, 100 + i // 4)) for i in range(16)]
    transfer = np.mean([np.abs(np.fft.rfft2(image)) for image in images], axis=0)
    f = np.fft.rfftfreq(201)
    fx, fy = np.meshgrid(f, np.fft.fftfreq(201))
    used = applied_mtf(fx, fy, optics, SQUARE)
    # a point's own spread differs a little with its place on the coarser grids
    assert np.abs(transfer - used).max() < 0.01
    inner = np.hypot(fx, fy) < 0.45
    assert np.abs(used - optics_mtf(fx, fy, optics, SQUARE))[inner].max() < 0.02


def test_a_defocus_disc_is_round_on_the_detector_not_in_pixels():
    sensor = Sensor(preset="t", blur_sigma_px=0.0, pixel_pitch_x_m=4e-6, pixel_pitch_y_m=8e-6)
    assert psf_pyramid(Optics(), sensor, 16.0) is None
    kernel = psf_kernel(Optics(), sensor, 16.0)
    n = kernel.shape[0] // 2
    y, x = np.mgrid[-n : n + 1, -n : n + 1]
    # the variance of a disc is a sixteenth of its diameter's square; what rings at its rim adds a little
    assert (kernel * x**2).sum() == pytest.approx(16**2 / 16, rel=0.15)
    assert (kernel * y**2).sum() == pytest.approx(8**2 / 16, rel=0.15)


def test_wide_asymmetric_psf_kernel_is_reproduced():
    y, x = np.mgrid[-15:16, -15:16]
    coma = np.exp(-((x - 0.15 * np.hypot(x, y)) ** 2 + y**2) / 3) + 0.004 / (1 + np.hypot(x - 3, y) ** 2)
    kernel = coma / coma.sum()
    optics = Optics(psf="kernel", kernel=tuple(map(tuple, kernel)))
    assert psf_pyramid(optics, SQUARE, 0.0) is not None
    found = np.mean(
        [np.roll(point(optics, at=(100 + i, 100 + j)), (-i, -j), (0, 1)) for i in range(8) for j in range(8)],
        0,
    )
    rows = slice(85, 116)
    assert np.abs(found[rows, rows] - kernel).max() < 0.01 * kernel.max()
    assert np.abs(found[rows, rows] - kernel).sum() < 0.03
    # the tail is on its own side
    assert found[100, 110] > 1.3 * found[100, 90]
    # what has structure that a pyramid cannot hold is convolved tap by tap
    rough = np.random.default_rng(0).random((31, 31))
    assert (
        psf_pyramid(Optics(psf="kernel", kernel=tuple(map(tuple, rough / rough.sum()))), SQUARE, 0.0) is None
    )


@pytest.mark.parametrize("shape", [(1, 1), (9, 500), (64, 31, 3), (131, 40)])
@pytest.mark.parametrize("sigma_px", [0.4, 1.0, 4.0])
@pytest.mark.parametrize("least", [0, 1 << 30])
def test_blur_of_row_blocks_equals_blur_of_the_image(shape, sigma_px, least, monkeypatch):
    monkeypatch.setattr(psf, "_THREAD_BLOCK_VALUES", 1000)
    monkeypatch.setattr(psf, "_BLOCK_VALUES", 1000)
    monkeypatch.setattr(psf, "_MIN_THREADED_VALUES", least)
    image = np.random.default_rng(2).random(shape, np.float32)
    taps = psf.gaussian_taps(sigma_px)
    whole = cv2.sepFilter2D(image, cv2.CV_32F, taps, taps * np.float32(0.3), borderType=cv2.BORDER_REPLICATE)
    np.testing.assert_array_equal(psf.gaussian_blur(image, sigma_px, 0.3), whole.reshape(shape))
    if len(shape) == 3:
        gain = np.array([0.7, 1.1, 0.4], np.float32)
        whole = cv2.sepFilter2D(image * gain, cv2.CV_32F, taps, taps, borderType=cv2.BORDER_REPLICATE)
        np.testing.assert_array_equal(psf.gaussian_blur(image, sigma_px, gain), whole)


@pytest.mark.parametrize("shape", [(3, 3), (5, 3), (3, 7), (9, 9), (11, 11)])
@pytest.mark.parametrize("bands", [1, 3])
def test_a_point_s_picture_is_the_measured_kernel_and_not_its_mirror_image(shape, bands):
    rng = np.random.default_rng(shape[0] * 10 + shape[1])
    kernel = rng.random(shape) * np.linspace(0.2, 3, shape[1]) * np.linspace(2, 0.1, shape[0])[:, None]
    kernel /= kernel.sum()
    optics = Optics(psf="kernel", kernel=tuple(map(tuple, kernel)))
    image = np.zeros((41, 43) if bands == 1 else (41, 43, 3), np.float32)
    image[18, 25] = 1.0
    seen = expose(image, SQUARE, 1.0, 0.1 if bands == 1 else [0.1, 0.1, 0.1], optics)
    seen = seen if bands == 1 else seen[..., 1]
    down, right = shape[0] // 2, shape[1] // 2
    patch = seen[18 - down : 18 + down + 1, 25 - right : 25 + right + 1]
    # wider ones may be laid down as a pyramid, within a hundredth of their transfer function
    tolerance = 1e-6 if max(shape) <= 9 else 0.03 * kernel.max()
    assert np.abs(patch / seen.sum() - kernel).max() <= tolerance
    for mirrored in (kernel[::-1], kernel[:, ::-1], kernel[::-1, ::-1]):
        assert np.abs(patch / seen.sum() - mirrored).max() > 0.2 * kernel.max()


@pytest.mark.parametrize(("focus_m", "distance_m"), [(10.0, 3.0), (3.0, 10.0), (10.0, 10.0), (0.0, 5.0)])
def test_a_disc_of_defocus_is_where_the_cone_behind_a_thin_lens_meets_the_detector(focus_m, distance_m):
    """Gauss's lens formula: the cone of a point's light is as wide as its image is away from the detector."""
    camera = Camera(width_px=64, height_px=48, fx_px=5000.0, fy_px=5000.0, cx_px=31.5, cy_px=23.5)
    optics = Optics(f_number=2.8, defocus=True, focus_distance_m=focus_m)
    f = 5000.0 * SQUARE.pixel_pitch_x_m
    detector, image = (1 / (1 / f - (1 / d if d else 0.0)) for d in (focus_m, distance_m))
    cone_m = f / 2.8 * abs(detector - image) / image
    found = optics.defocus_diameter_px(camera, SQUARE, distance_m)
    assert found == pytest.approx(cone_m / SQUARE.pixel_pitch_x_m, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("kernel", [np.ones((4, 5)), np.ones((5, 4)), np.zeros((5, 5))])
def test_a_kernel_that_would_shift_or_darken_the_image_is_refused(kernel):
    with pytest.raises(ValueError, match="is even or zero"):
        fit_kernel(kernel)
