"""Every noise of every frame has its own random stream."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from flyaround.simulator.camera.detector.readout import detect
from flyaround.simulator.camera.detector.sensor import Detector, Sensor
from flyaround.simulator.imaging.image_formation import digitise

SIDE = 192
QUIET = Detector(
    full_well_e=1e6, gain_e_per_dn=4.0, black_level_dn=8000.0, read_noise_e=0.0, shot_noise=False
)
# each noise alone, wide against a digital number
PIXEL_TERMS = {
    "photons": {"shot_noise": True},
    "read-out": {"read_noise_e": 400.0},
    "sensitivity": {"prnu": 0.05},
    "offset": {"dsnu_e": 400.0},
    "dark current": {"dark_current_e_s": 4e5, "dark_nonuniformity": 0.2},
}
LINE_TERMS = {"rows": {"row_noise_e": 400.0}, "columns": {"column_noise_e": 400.0}}


def pattern(changes, seed=3, frame=5):
    """What a noise adds to an even grey, rank by rank, so that the shape of its law does not count."""
    sensor = Sensor(preset="test", bits=16, detector=replace(QUIET, **changes))
    image = detect(np.full((SIDE, SIDE), 0.2, np.float32), sensor, seed, frame, 0.01).astype(float)
    return image - image.mean()


def likeness(a, b):
    """Correlation of the ranks of two series, whichever way round: 1 for one stream, 1 / sqrt(n) by chance."""
    ranks = [np.argsort(np.argsort(x.ravel(), kind="stable"), kind="stable").astype(float) for x in (a, b)]
    return abs(np.corrcoef(*ranks)[0, 1])


def test_noises_of_pixels_are_drawn_apart():
    """The variance of two noises together is the sum of each alone: of one stream it would be up to twice that."""
    patterns = {name: pattern(changes) for name, changes in PIXEL_TERMS.items()}
    for one in patterns.values():
        assert one.std() > 20
    for (a, first), (b, second) in combinations(patterns.items(), 2):
        both = pattern(PIXEL_TERMS[a] | PIXEL_TERMS[b])
        shared = (both.var() - first.var() - second.var()) / (2 * first.std() * second.std())
        assert abs(shared) < 6 / SIDE, (a, b)
    # nor is one band of rows like another: eight of them, each with its own
    rows = SIDE // 8
    bands = [patterns["read-out"][k * rows : (k + 1) * rows] for k in range(8)]
    for first, second in combinations(bands, 2):
        assert likeness(first, second) < 6 / np.sqrt(first.size)


def test_rows_and_columns_share_no_stream_with_each_other_nor_with_pixels():
    rows = pattern(LINE_TERMS["rows"]).mean(axis=1)
    columns = pattern(LINE_TERMS["columns"]).mean(axis=0)
    limit = 5 / np.sqrt(SIDE)
    assert likeness(rows, columns) < limit
    for changes in PIXEL_TERMS.values():
        start = pattern(changes).ravel()[:SIDE]  # a shared stream would begin alike
        assert likeness(rows, start) < limit
        assert likeness(columns, start) < limit


@pytest.mark.parametrize("changes", [PIXEL_TERMS["read-out"], PIXEL_TERMS["photons"], LINE_TERMS["rows"]])
def test_frames_seeds_and_bands_of_colour_have_their_own(changes):
    base = pattern(changes)
    limit = 6 / SIDE if changes not in LINE_TERMS.values() else 5 / np.sqrt(SIDE)
    for seed, frame in ((3, 6), (4, 5), (5, 3)):
        other = pattern(changes, seed, frame)
        if changes in LINE_TERMS.values():
            assert likeness(base.mean(axis=1), other.mean(axis=1)) < limit
        else:
            assert likeness(base, other) < limit
    sensor = Sensor(preset="test", bits=16, detector=replace(QUIET, **changes))
    colour = detect(np.full((SIDE, SIDE, 3), 0.2, np.float32), sensor, 3, 5, 0.01).astype(float)
    for a, b in combinations(range(3), 2):
        first, second = (colour[..., k] - colour[..., k].mean() for k in (a, b))
        if changes in LINE_TERMS.values():
            first, second = first.mean(axis=1), second.mean(axis=1)
        assert likeness(first, second) < limit


def test_two_noises_of_a_recipe_use_different_streams():
    flat = np.full((SIDE, SIDE), 0.5, np.float32)
    speckle, gaussian = (
        digitise(flat, Sensor(preset="test", bits=16, blur_sigma_px=0.0, **only), 3, 5).astype(float)
        for only in (
            {"speckle_variance": 0.01, "gaussian_variance": 0.0},
            {"speckle_variance": 0.0, "gaussian_variance": 0.003},
        )
    )
    assert min(speckle.std(), gaussian.std()) > 1000
    assert likeness(speckle, gaussian) < 6 / SIDE
    # of one stream of bytes, two neighbours would make one uniform number, and each a normal number of its own
    half = SIDE * SIDE // 2
    for first in (0, 1):
        assert likeness(speckle.ravel()[:half], gaussian.ravel()[first::2]) < 6 / np.sqrt(half)
    together = digitise(
        flat,
        Sensor(preset="test", bits=16, blur_sigma_px=0.0, speckle_variance=0.01, gaussian_variance=0.003),
        3,
        5,
    ).astype(float)
    assert together.var() == pytest.approx(speckle.var() + gaussian.var(), rel=0.03)
