"""The detector in electrons: Poisson statistics, photon transfer, saturation, fixed pattern."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from flyaround.simulator.camera.detector.charge import bloom, cosmic_ray_charge, fixed_pattern
from flyaround.simulator.camera.detector.readout import detect, mosaic
from flyaround.simulator.camera.detector.sensor import Detector, Sensor, noiseless
from flyaround.simulator.imaging.image_formation import digitise, noise_sigma

QUIET = Detector(full_well_e=20_000.0, gain_e_per_dn=5.0, black_level_dn=64.0, read_noise_e=0.0)


def sensor(**changes):
    return Sensor(preset="test", bits=12, blur_sigma_px=0.0, detector=replace(QUIET, **changes))


def flat(electrons, s, shape=(400, 500)):
    return np.full(shape, electrons / s.saturation_e, np.float32)


def test_variance_over_mean_is_one_over_the_gain():
    s = sensor(read_noise_e=12.0)
    levels = np.array([200.0, 1000.0, 4000.0, 9000.0])
    frames = [detect(flat(e, s), s, 1, k, 0.01).astype(float) for k, e in enumerate(levels)]
    dark = detect(flat(0.0, s), s, 1, 9, 0.01).astype(float)
    slope = np.polyfit([f.mean() - 64 for f in frames], [f.var() for f in frames], 1)[0]
    assert 1 / slope == pytest.approx(5.0, rel=0.01)
    assert np.sqrt(dark.var() - 1 / 12) * 5.0 == pytest.approx(12.0, rel=0.01)


def test_the_fixed_pattern_stays_and_belongs_to_the_serial_number_and_the_place():
    s = sensor(prnu=0.02, dsnu_e=30.0, serial=7)
    mean = np.mean(
        [detect(flat(8000.0, s, (60, 80)), s, 1, k, 0.01).astype(float) for k in range(64)], axis=0
    )
    again = np.mean(
        [detect(flat(8000.0, s, (60, 80)), s, 2, k, 0.01).astype(float) for k in range(64)], axis=0
    )
    assert np.corrcoef(mean.ravel(), again.ravel())[0, 1] > 0.95
    other = replace(s, detector=replace(s.detector, serial=8))
    third = detect(flat(8000.0, other, (60, 80)), other, 1, 0, 0.01).astype(float)
    assert abs(np.corrcoef(mean.ravel(), third.ravel())[0, 1]) < 0.1
    # a region of interest sees the pixels that the whole image would
    roi = replace(s, detector=replace(s.detector, roi_x0_px=20, roi_y0_px=10))
    part = np.mean(
        [detect(flat(8000.0, roi, (40, 40)), roi, 3, k, 0.01).astype(float) for k in range(64)], axis=0
    )
    assert np.corrcoef(mean[10:50, 20:60].ravel(), part.ravel())[0, 1] > 0.95


def test_dark_current_doubles_with_its_temperature_step():
    s = sensor(dark_current_e_s=1000.0, dark_doubling_c=6.0)
    warm = replace(s, detector=replace(s.detector, temperature_c=32.0))
    cold_dn, warm_dn = (detect(flat(0.0, k), k, 0, 0, 1.0).mean() - 64 for k in (s, warm))
    assert cold_dn * 5 == pytest.approx(1000, rel=0.01)
    assert warm_dn * 5 == pytest.approx(4000, rel=0.01)


def test_saturation_hot_and_dead_pixels():
    s = sensor(hot_pixel_share=0.01, hot_pixel_e_s=50_000.0, dead_pixel_share=0.02)
    image = detect(flat(5000.0, s), s, 0, 0, 0.1)
    assert np.mean(image < 100) == pytest.approx(0.02, rel=0.1)
    assert np.mean(image > 1500) == pytest.approx(0.01 * np.exp(-(1500 - 1064) / 1000), rel=0.2)
    assert detect(flat(1e6, s, (20, 20)), s, 0, 0, 0.0).max() == 64 + 20_000 // 5


def test_blooming_keeps_what_the_drain_does_not_take():
    charge = np.zeros((41, 3), np.float32)
    charge[20, 1] = 11_000.0
    bloom(charge, 1000.0, 1.0)
    assert charge.sum() == pytest.approx(11_000)
    assert (charge[15:26, 1] == 1000).all()
    assert charge[:15].sum() == 0
    assert charge[:, [0, 2]].sum() == 0


def test_blooming_conserves_charge():
    rng = np.random.default_rng(3)
    charge = rng.uniform(0, 1500, (60, 9)).astype(np.float32)
    charge[20:24, 4] = 30_000.0
    before = charge.copy()
    bloom(charge, 1000.0, 0.6)
    expected = np.minimum(before, 1000.0).astype(float)
    for way in (1, -1):  # pixel by pixel: what arrives fills the room there is, the rest goes on
        for column in range(9):
            carried = 0.0
            for row in range(60)[::way]:
                taken = min(carried, 1000.0 - expected[row, column])
                expected[row, column] += taken
                carried += 0.6 / 2 * max(before[row, column] - 1000.0, 0) - taken
    assert charge == pytest.approx(expected, abs=0.05)


def test_blooming_leaves_columns_alone_that_have_no_full_well():
    plain, blooms = sensor(read_noise_e=12.0, prnu=0.01), sensor(read_noise_e=12.0, prnu=0.01, blooming=1.0)
    light = flat(8000.0, plain, (200, 300))
    # a picture without a full well is the same to the last digit
    assert np.array_equal(detect(light, plain, 4, 2, 0.01), detect(light, blooms, 4, 2, 0.01))
    light[100, 150] = 6.0
    image = detect(light, blooms, 4, 2, 0.01).astype(float)
    others = np.delete(image, 150, axis=1)
    assert others.std() * 5 == pytest.approx(np.sqrt(8000 + 12**2 + 80**2), rel=0.02)
    assert others.mean() * 5 == pytest.approx(8000 + 64 * 5, rel=2e-3)
    # five wells of overflow fill what eight thousand electrons leave of twenty thousand
    spilled = (6.0 * plain.saturation_e - 20_000) / (20_000 - 8_000)
    assert np.sum(image[:, 150] > 64 + 3800) == pytest.approx(spilled + 1, abs=2)


def test_binning_adds_charge_and_reads_once_or_four_times():
    single, charge, digital = (
        sensor(read_noise_e=10.0, binning=b, charge_binning=c) for b, c in ((1, False), (2, True), (2, False))
    )
    noise = [detect(flat(0.0, s), s, 0, 0, 0.0).astype(float) for s in (single, charge, digital)]
    sigma = [np.sqrt(n.var() - 1 / 12) * 5 for n in noise]
    assert sigma == pytest.approx([10, 10, 20], rel=0.02)
    assert charge.saturation_e == min(80_000, (4095 - 64) * 5)


def test_row_and_column_noise_are_common_to_their_line():
    s = sensor(row_noise_e=50.0, column_noise_e=30.0)
    image = detect(flat(0.0, s), s, 0, 0, 0.0).astype(float)
    assert image.mean(axis=1).std() * 5 == pytest.approx(50, rel=0.15)
    assert image.mean(axis=0).std() * 5 == pytest.approx(30, rel=0.15)


def test_particles_leave_tracks_at_their_rate_and_the_same_ones_again():
    s = sensor(cosmic_rays_cm2_s=2000.0, layer_m=10e-6)
    image = detect(flat(0.0, s), s, 5, 0, 0.2)
    assert np.array_equal(image, detect(flat(0.0, s), s, 5, 0, 0.2))
    assert not np.array_equal(image, detect(flat(0.0, s), s, 5, 1, 0.2))
    expected = 2000 * 0.2 * image.size * 5.86e-4**2
    charge = (image.astype(float) - 64).clip(0) * 5
    # the mean path through the layer is two layers, at 80 electrons a micrometre
    assert charge.sum() == pytest.approx(expected * 80 * 20, rel=0.4)


@pytest.mark.parametrize("corner", [(0, 0), (101, 51), (100, 51), (7, 4)])
@pytest.mark.parametrize("pattern", ["rggb", "bggr", "grbg", "gbrg"])
def test_a_mosaic_comes_back_as_its_colour_wherever_the_region_begins(pattern, corner):
    s = noiseless(sensor(colour_filter=pattern, roi_x0_px=corner[0], roi_y0_px=corner[1]))
    colour = np.zeros((32, 32, 3), np.float32)
    colour[:] = [0.6, 0.4, 0.2]
    image = detect(colour, s, 0, 0, 0.0).astype(float) - 64
    assert image[8:24, 8:24].reshape(-1, 3).mean(axis=0) / (s.saturation_e / 5) == pytest.approx(
        [0.6, 0.4, 0.2], abs=2e-3
    )
    raw = mosaic(colour, s.detector)
    first = pattern[2 * (corner[1] % 2) + corner[0] % 2]
    assert raw[0, 0] == pytest.approx({"r": 0.6, "g": 0.4, "b": 0.2}[first])


def test_declared_sigma_is_the_pictures():
    s = sensor(read_noise_e=12.0, prnu=0.01, dark_current_e_s=500.0, row_noise_e=5.0)
    for level in (0.0, 0.4):
        image = digitise(np.full((600, 600), level, np.float32), s, 1, 2, 0.05).astype(float)
        assert noise_sigma(s, level, 0.05) == pytest.approx(image.std() * 5 / s.saturation_e, rel=0.02)


def test_noise_free_sensor_keeps_the_scale():
    s = noiseless(sensor(read_noise_e=12.0, prnu=0.01, dark_current_e_s=500.0))
    image = digitise(flat(5000.0, s), s, 1, 2, 0.05)
    assert (image == 1064).all()


def test_tracks_of_particles_have_the_angles_of_an_even_sky():
    """Through a flat layer the cosine's square is uniform, the turn even; a track is as long as its charge says."""
    layer, pitch = 60e-6, (3e-6, 5e-6)
    s = replace(
        sensor(cosmic_rays_cm2_s=3000.0, layer_m=layer), pixel_pitch_x_m=pitch[0], pixel_pitch_y_m=pitch[1]
    )
    charge = cosmic_ray_charge(s, 1500, 1500, 1.0, 3, 0)
    n, names, boxes, _ = cv2.connectedComponentsWithStats((charge > 0).astype(np.uint8), connectivity=8)
    assert n > 700  # that of three thousand a square centimetre, few of them crossing
    # path over the layer: the charge of one, in 80 electrons a micrometre
    total = np.bincount(names.ravel(), charge.ravel(), minlength=n)[1:] / (80e6 * layer)
    # half within root two, three quarters within two
    share = [np.mean(total < limit) for limit in (np.sqrt(2), 2.0)]
    assert share == pytest.approx([0.5, 0.75], abs=3 * 0.5 / np.sqrt(n))
    width, height = boxes[1:, cv2.CC_STAT_WIDTH], boxes[1:, cv2.CC_STAT_HEIGHT]
    across = layer * np.sqrt(np.clip(total**2 - 1, 0, None))
    seen = np.hypot((width - 1) * pitch[0], (height - 1) * pitch[1])
    left, top = boxes[1:, cv2.CC_STAT_LEFT], boxes[1:, cv2.CC_STAT_TOP]
    whole = (left > 0) & (top > 0) & (left + width < 1500) & (top + height < 1500) & (total < 4)
    assert total[whole].min() > 0.95
    assert np.median(np.abs(seen - across)[whole]) < np.hypot(*pitch)
    # as many along the rows as along the columns, in metres, and as many of either slant
    long = whole & (total > 1.5)
    wide = (width * pitch[0] > height * pitch[1])[long]
    slants = []
    for k in np.flatnonzero(long) + 1:
        x, y, w, h = boxes[k, :4]
        rows, columns = np.nonzero(names[y : y + h, x : x + w] == k)
        slants.append(np.sum((rows - rows.mean()) * (columns - columns.mean())))
    bound = 3 * 0.5 / np.sqrt(long.sum())
    assert wide.mean() == pytest.approx(0.5, abs=bound)
    assert np.mean(np.array(slants) > 0) == pytest.approx(0.5, abs=bound)


@pytest.mark.parametrize("b", [2, 3])
def test_binned_pattern_is_that_of_the_pixels_it_joins(b):
    """Sensitivity is their mean, offset and dark current their sums: noise of sensitivity falls as 1 / b."""
    single = Detector(
        prnu=0.05, dsnu_e=20.0, dark_current_e_s=100.0, dark_nonuniformity=0.3, dead_pixel_share=0.01
    )
    whole, binned = fixed_pattern(single, 60, 90), fixed_pattern(replace(single, binning=b), 60 // b, 90 // b)

    def blocks(values):
        return values.reshape(60 // b, b, 90 // b, b)

    assert binned.sensitivity == pytest.approx(blocks(whole.sensitivity).mean(axis=(1, 3)), rel=1e-5)
    assert binned.offset_e == pytest.approx(blocks(whole.offset_e).sum(axis=(1, 3)), abs=1e-3)
    assert binned.dark_e_s == pytest.approx(blocks(whole.dark_e_s).sum(axis=(1, 3)), rel=1e-5)


@pytest.mark.parametrize("charge_binning", [True, False])
@pytest.mark.parametrize("b", [1, 2, 4])
def test_declared_sigma_of_a_binned_pattern_is_the_pictures(b, charge_binning):
    """Where sensitivity differs by a tenth nothing else counts: it averages over the pixels of a bin."""
    s = sensor(prnu=0.1, dark_current_e_s=500.0, dsnu_e=10.0, binning=b, charge_binning=charge_binning)
    image = digitise(np.full((240, 240), 0.4, np.float32), s, 1, 2, 0.05).astype(float)
    # the sigma of 57,600 pixels is known to 0.3 %
    declared = noise_sigma(s, 0.4, 0.05)
    assert declared == pytest.approx(image.std() * 5 / s.saturation_e, rel=0.02)
    assert declared > 0.9 * 0.1 / b * 0.4


@pytest.mark.parametrize("charge_binning", [True, False])
@pytest.mark.parametrize("b", [1, 2, 4])
def test_declared_sigma_of_binned_dark_current_is_the_pictures(b, charge_binning):
    """In the dark, where the current of all pixels of a bin adds up, and its differences average."""
    s = sensor(dark_current_e_s=20_000.0, dark_nonuniformity=0.02, binning=b, charge_binning=charge_binning)
    image = digitise(np.zeros((240, 240), np.float32), s, 1, 2, 0.05).astype(float)
    assert noise_sigma(s, 0.0, 0.05) == pytest.approx(image.std() * 5 / s.saturation_e, rel=0.02)
