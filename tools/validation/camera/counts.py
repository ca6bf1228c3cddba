"""Chi-square tests of counts sampled by the simulated detector against their exact distributions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import chi2, norm
from scipy.stats import poisson as poisson_law

from flyaround.simulator.camera.detector.deviates import bit_source, poisson
from flyaround.simulator.camera.detector.readout import detect

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.runtime.arrays import FloatArray

SAMPLES = 100_000  # number of samples of each distribution
SHAPE = (250, 400)  # size of an image with as many pixels
MIN_EXPECTED = 20.0  # minimum expected count of a bin
_REACH = 9.0  # standard deviations on either side over which the distributions are summed


def chi_square(counts: NDArray[np.int_], expected: FloatArray) -> tuple[float, int, float]:
    """Return the statistic, degrees of freedom and p-value; neighbouring bins are merged until each expects 20."""
    ends = []
    total = 0.0
    for k, value in enumerate(expected):
        total += value
        if total >= MIN_EXPECTED:
            ends.append(k + 1)
            total = 0.0
    starts = np.array([0, *ends[:-1]])  # the last bin takes the remainder
    observed, ideal = np.add.reduceat(counts, starts), np.add.reduceat(expected, starts)
    statistic = float(((observed - ideal) ** 2 / ideal).sum())
    return statistic, len(starts) - 1, float(chi2.sf(statistic, len(starts) - 1))


def electron_chance(mean_e: float, *, seed: int = 3) -> tuple[float, int, float]:
    """Test 1e5 sampled electron counts against the Poisson distribution."""
    source = bit_source(seed, round(mean_e * 10))
    drawn = poisson(np.full(SHAPE, mean_e, np.float32), source).astype(int).ravel()
    top = int(mean_e + _REACH * np.sqrt(mean_e) + _REACH)
    expected = SAMPLES * poisson_law.pmf(np.arange(top + 1), mean_e)
    expected[-1] += SAMPLES * poisson_law.sf(top, mean_e)
    return chi_square(np.bincount(np.minimum(drawn, top), minlength=top + 1), expected)


def reading_chance(sensor: Sensor, mean_e: float, *, seed: int = 3) -> tuple[float, int, float]:
    """Test 1e5 digital numbers against photons, full well, read noise and converter, without fixed-pattern noise."""
    signal = np.full(SHAPE, mean_e / sensor.saturation_e, np.float32)
    drawn = detect(signal, sensor, seed, 0, 0.0).astype(int).ravel()
    expected = SAMPLES * reading_law(sensor, mean_e)
    return chi_square(np.bincount(drawn, minlength=expected.size), expected)


def reading_law(sensor: Sensor, mean_e: float) -> FloatArray:
    """Return the probability of each digital number, (2^bits,)."""
    d = sensor.detector
    if d is None:
        raise ValueError(f"sensor {sensor.preset} counts no electrons")
    reach = _REACH * np.sqrt(mean_e) + _REACH
    electrons = np.arange(max(int(mean_e - reach), 0), int(mean_e + reach) + 2)
    chance = poisson_law.pmf(electrons, mean_e)
    stored = np.minimum(electrons, d.full_well_e * d.pixels_per_bin)[chance > 1e-12]
    charge, index = np.unique(stored, return_inverse=True)
    weight = np.bincount(index, chance[chance > 1e-12])
    middle_dn = np.array([charge[0], charge[-1]]) / d.gain_e_per_dn + d.black_level_dn
    reach_dn = _REACH * d.read_noise_per_pixel_e / d.gain_e_per_dn + 2
    full = 2**sensor.bits - 1
    first, last = np.clip((middle_dn + np.array([-1, 1]) * reach_dn).astype(int), 0, full)
    # cumulative probability of each number between first and last
    edges_e = (np.arange(first, last) + 0.5 - d.black_level_dn) * d.gain_e_per_dn
    below = weight @ norm.cdf((edges_e - charge[:, None]) / d.read_noise_per_pixel_e)
    law = np.zeros(full + 1)
    law[first : last + 1] = np.diff(np.concatenate([[0.0], below, [1.0]])).clip(0)
    return law
