"""Fast random numbers: normal distribution, no correlation, independence of the number of threads."""

import numpy as np
import pytest
from scipy.stats import kstest

from flyaround.simulator.camera.detector.deviates import (
    add_normal,
    bit_source,
    normal_tables,
    uniform_factors,
)


def _normal(count, *, seed=1, sigma=1.0, dtype=np.float32):
    values = np.zeros((count // 1000, 1000), dtype)
    add_normal(values, normal_tables(sigma, np.dtype(dtype)), bit_source(seed, 0))
    return values


def test_deviates_are_normally_distributed():
    values = _normal(1_000_000).astype(float).ravel()
    n = values.size
    assert abs(values.mean()) < 5 / np.sqrt(n)
    assert values.var() == pytest.approx(1, abs=5 * np.sqrt(2 / n))
    assert (values**4).mean() == pytest.approx(3, abs=5 * np.sqrt(96 / n))
    # what the law itself differs by, 6e-4, and what a million draws scatter by
    assert kstest(values[:200_000], "norm").statistic < 6e-4 + 1.95 / np.sqrt(200_000)
    assert np.mean(np.abs(values) > 3) == pytest.approx(0.0027, rel=0.1)


def test_deviates_are_white_along_rows_and_columns_and_between_sources():
    first, second = _normal(1_000_000), _normal(1_000_000, seed=2)
    limit = 5 / np.sqrt(first.size)
    assert abs(float((first[:, 1:] * first[:, :-1]).mean())) < limit
    assert abs(float((first[1:] * first[:-1]).mean())) < limit
    assert abs(float((first * second).mean())) < limit
    # no hidden period: the power of every spatial frequency is that of white noise
    power = np.abs(np.fft.rfft2(first[:512, :512])) ** 2 / 512**2
    assert power[1:, 1:-1].max() < 18  # exponential law, 1.3e5 frequencies: exp(-18) each
    assert power[1:, 1:-1].mean() == pytest.approx(1, abs=0.02)


def test_whole_number_deviates_keep_their_standard_deviation():
    values = _normal(1_000_000, sigma=765.0, dtype=np.int16)
    assert values.astype(float).std() == pytest.approx(765, rel=5 / np.sqrt(2 * values.size))


def test_uniform_factor_has_its_variance_and_bounds():
    values = uniform_factors((1000, 1000), 0.3, bit_source(4))
    assert values.min() >= 0.7
    assert values.max() <= 1.3
    assert values.mean() == pytest.approx(1, abs=5e-4)
    assert values.var() == pytest.approx(0.3**2 / 3, rel=5e-3)
