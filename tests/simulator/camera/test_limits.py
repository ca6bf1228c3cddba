"""What a detector may be: a file that is read today is read tomorrow, and what no detector is stays refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.camera.detector.limits import optics_problem, sensor_problem
from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.presets import sensor_preset

SENSOR = replace(sensor_preset("cmv4000"), bits=16)
LIMITS = {
    "full_well_e": (1.0, 1e9),
    "gain_e_per_dn": (1e-4, 1e6),
    "black_level_dn": (0.0, 60_000.0),
    "read_noise_e": (0.0, 1e5),
    "row_noise_e": (0.0, 1e5),
    "column_noise_e": (0.0, 1e5),
    "dsnu_e": (0.0, 1e6),
    "dark_nonuniformity": (0.0, 1.0),
    "prnu": (0.0, 0.5),
    "hot_pixel_share": (0.0, 1.0),
    "dead_pixel_share": (0.0, 1.0),
    "blooming": (0.0, 1.0),
    "cosmic_rays_cm2_s": (0.0, 1e6),
}
OPTICS = {"f_number": (0.5, 64.0), "transmission": (1e-6, 1.0), "wavelength_m": (200e-9, 2000e-9)}


@pytest.mark.parametrize("key", LIMITS)
def test_a_detector_within_the_limits_is_taken_and_no_other(key: str) -> None:
    low, high = LIMITS[key]
    for value in (low, high, 0.5 * (low + high)):
        assert sensor_problem(replace(SENSOR, detector=replace(SENSOR.detector, **{key: value}))) is None
    for value in (np.nextafter(low, -np.inf), np.nextafter(high, np.inf), np.nan):
        problem = sensor_problem(replace(SENSOR, detector=replace(SENSOR.detector, **{key: value})))
        assert f"{key} is" in problem
        assert "allowed" in problem


@pytest.mark.parametrize("key", OPTICS)
def test_optics_within_the_limits_are_taken_and_no_others(key: str) -> None:
    low, high = OPTICS[key]
    for value in (low, high):
        assert optics_problem(replace(Optics(), **{key: value})) is None
    for value in (np.nextafter(low, 0), np.nextafter(high, np.inf)):
        assert f"{key} is" in optics_problem(replace(Optics(), **{key: value}))
