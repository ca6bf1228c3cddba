"""The signal of a white surface that faces a light: falls with the square of the distance, and is always finite."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.imaging.metering import light_signal
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.scene.illumination.area_light import AreaLight
from flyaround.simulator.scene.illumination.lamp import Lamp


@pytest.fixture(scope="module")
def scene():
    return plan_flight(load_scenario("tango-space-10m"), n=1).scene(0)


def at_range(scene, range_m):
    return replace(scene, t_camera_from_target_m=(0.0, 0.0, range_m))


def lights():
    lamp = Lamp(power_w=40.0)
    box = AreaLight(position_m=(0.0, 0.0, 0.0), radiance_w_m2_sr=500.0, width_m=0.1, height_m=0.1)
    return [lamp, box]


@pytest.mark.parametrize("light", lights(), ids=["lamp", "box"])
def test_twice_the_distance_is_a_quarter_of_the_signal(scene, light):
    near, far = (light_signal(at_range(scene, range_m), light) for range_m in (20.0, 40.0))
    assert near > 0.0
    assert far == pytest.approx(near / 4.0, rel=1e-2)


def test_a_light_on_the_surface_has_a_finite_signal(scene):
    lamp = Lamp(power_w=40.0)
    here = replace(scene, t_camera_from_target_m=tuple(lamp.offset_m))
    assert np.isfinite(light_signal(here, lamp))
