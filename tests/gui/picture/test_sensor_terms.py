"""The sensor's numbers in the console: listed, changed within their limits, drawn as a histogram."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flyaround.gui.app import options_of
from flyaround.gui.picture.sensor_terms import BINS, checked_change, histogram_of, terms_of
from flyaround.gui.picture.view_settings import apply_view_settings, changed_sensor
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario


@pytest.mark.parametrize("preset", ["speed", "imx174"])
def test_each_number_that_is_listed_can_be_changed(preset: str) -> None:
    sensor = sensor_preset(preset)
    for term in terms_of(sensor):
        # the unit beside the name, and what a change does
        assert term.text.endswith("]")
        assert term.effect
        changes = checked_change(sensor, {}, term.name, repr(term.value))
        assert changed_sensor(sensor, changes) == sensor, term.name


def test_a_number_out_of_its_limits_or_of_another_sensor_is_refused() -> None:
    sensor = sensor_preset("speed")
    with pytest.raises(UserError, match=r"Additive noise, variance \[1\] is 2, allowed: 0 to 1"):
        checked_change(sensor, {}, "gaussian_variance", "2.0")
    with pytest.raises(UserError, match="has no read_noise_e"):
        checked_change(sensor, {}, "read_noise_e", "2.0")


def test_changes_reach_the_scene_and_no_noise_is_none() -> None:
    session = FlightSession.of(load_scenario("tango-flyaround"))
    settings = options_of(session).settings
    settings.sensor_changes = {"gaussian_variance": 0.5}
    assert apply_view_settings(session.scene(), settings).sensor.gaussian_variance == 0.5
    settings.noise = False
    assert apply_view_settings(session.scene(), settings).sensor.gaussian_variance == 0.0
    # a detector's noise too
    counting = replace(session.scene(), sensor=sensor_preset("imx174"))
    detector = apply_view_settings(counting, settings).sensor.detector
    assert detector is not None
    assert (detector.read_noise_e, detector.shot_noise) == (0.0, False)


@pytest.mark.parametrize(("bits", "bands"), [(8, 1), (12, 1), (8, 3)])
def test_a_histogram_counts_every_pixel_once(bits: int, bands: int) -> None:
    full = 2**bits - 1
    shape = (40, 50) if bands == 1 else (40, 50, bands)
    rng = np.random.Generator(np.random.PCG64(4))
    image = rng.integers(3, full, shape).astype(np.uint8 if bits == 8 else np.uint16)
    image[:4] = full
    found = histogram_of(image, bits)
    assert found.counts.shape == (bands, BINS)
    assert found.counts.sum() == image.size
    assert found.saturated == pytest.approx(0.1)
    assert (found.least_dn, found.most_dn) == (image.min(), full)
    assert abs(found.median_dn - np.median(image)) <= 1
