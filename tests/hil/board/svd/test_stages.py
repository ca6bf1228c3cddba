"""Stages of the published method on inputs whose answer is known."""

import numpy as np
import pytest

from flyaround.hil.board.svd.region_of_interest import cdf_box, crop_of, marginal_interval
from flyaround.hil.board.svd.segment_merging import merge_segments
from flyaround.hil.board.svd.settings import PublishedConfig
from flyaround.hil.board.svd.weak_gradients import eliminate_weak_gradients, exponential_threshold


def test_threshold_of_an_exponential_is_4605_times_its_mean():
    x = np.random.default_rng(2).exponential(0.02, 400_000)
    counts = np.histogram(x, 100, (0, 1))[0]
    threshold = exponential_threshold(counts, 0.99)
    assert threshold == pytest.approx(4.605 * 0.02, rel=0.05)
    assert (x > threshold).mean() == pytest.approx(0.01, abs=0.003)


def test_weak_gradients_vanish_and_the_outline_stays():
    image = np.random.default_rng(3).normal(20, 3, (120, 160)).astype(np.float32)
    image[40:80, 50:110] += 150
    strong = eliminate_weak_gradients(image).strong
    ys, xs = np.nonzero(strong)
    assert (xs.min(), xs.max(), ys.min(), ys.max()) == pytest.approx((49, 110, 39, 80), abs=2)
    assert not strong[45:75, 56:104].any()
    assert marginal_interval(np.ones(1000), 0.025, 0.975) == pytest.approx((24, 974), abs=1)


@pytest.mark.parametrize(("margin", "spare"), [(0.0, 0), (0.5, 1), (1.0, 1)])
def test_a_region_is_cropped_to_the_pixels_that_it_covers(margin, spare):
    strong = np.zeros((12, 20), bool)
    strong[2:5, 4:8] = True
    rows, columns = crop_of(cdf_box(strong), strong, margin)
    assert (rows, columns) == (slice(2 - spare, 5 + spare), slice(4 - spare, 8 + spare))


def test_broken_and_doubled_segments_become_one_line():
    pieces = [[10, 10, 50, 30], [56, 33, 90, 50], [12, 11.5, 60, 35.2], [10, 100, 90, 100]]
    merged = merge_segments(np.array(pieces, float), 150.0)
    assert len(merged) == 2
    first = merged[0].reshape(2, 2)
    assert first[np.argsort(first[:, 0])] == pytest.approx(np.array([[10, 10], [90, 50]]), abs=1.0)


@pytest.mark.parametrize(
    "wrong",
    [
        {"streams": ("lines",)},
        {"solver": "dlt"},
        {"merge_each": ("hough",)},
        {"roi_growth": np.nan},
        {"top": 0},
    ],
)
def test_settings_of_no_stage_are_refused(wrong):
    with pytest.raises(ValueError, match="mine: "):
        PublishedConfig("mine", **wrong)
