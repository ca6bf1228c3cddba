"""What exposure and gain do to the pictures: those that are looped, and those that are drawn."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.hil.host.camera_endpoint.messages import ImageRequest
from flyaround.hil.host.camera_endpoint.pictures import (
    WARM_UP_PICTURES,
    LoopedPictures,
    RenderedPictures,
    with_exposure,
)
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight


def wanted(number=0, exposure_s=0.01, gain_db=0.0):
    return ImageRequest(request_id=1, number=number, t_s=0.0, exposure_s=exposure_s, gain_db=gain_db)


def test_looped_pictures_take_exposure_and_gain():
    image = np.array([[10, 20, 100, 255]], np.uint8)
    looped = LoopedPictures([image], bits=8, exposure_s=0.01, black_dn=10)
    assert looped.take(wanted(3)).image is image
    assert looped.take(wanted(exposure_s=0.02)).image.tolist() == [[10, 30, 190, 255]]
    assert looped.take(wanted(gain_db=20 * np.log10(0.5))).image.tolist() == [[10, 15, 55, 132]]


def test_looped_pictures_of_different_exposures_are_taken_at_the_controllers():
    scene = plan_flight(load_scenario("tango-limb"), n=1).scene(0)
    scenes = [replace(scene, exposure_s=0.01), replace(scene, exposure_s=0.005)]
    images = [np.array([[40]], np.uint8), np.array([[20]], np.uint8)]
    looped = LoopedPictures(images, bits=8, exposure_s=0.01, scenes=scenes)
    taken = [looped.take(wanted(k)) for k in range(2)]
    assert [picture.image.tolist() for picture in taken] == [[[40]], [[40]]]
    assert [picture.scene.exposure_s for picture in taken] == [0.01, 0.01]


def test_drawn_scenes_take_exposure_and_gain():
    scene = plan_flight(load_scenario("tango-limb"), n=1).scene(0)
    changed = with_exposure(scene, wanted(exposure_s=0.005, gain_db=6.0))
    assert changed.exposure_s == 0.005
    assert scene.sensor.full_scale_j_m2_sr / changed.sensor.full_scale_j_m2_sr == pytest.approx(
        1.9953, abs=1e-3
    )
    # what is amplified is signal and noise alike
    assert changed.sensor.gaussian_variance / scene.sensor.gaussian_variance == pytest.approx(3.981, abs=1e-3)


class CountingProducer:
    """Draws nothing, and remembers of what."""

    def __init__(self):
        self.scenes = []

    def submit(self, request):
        self.scenes.append(request.scene)

    def result(self):
        return np.zeros((4, 4), np.uint8)


def test_moments_of_the_whole_flight_are_drawn_before_anybody_waits():
    """The first picture of a kind takes seconds: a client that waited 5 s for it took the camera for dead."""
    plan = plan_flight(load_scenario("tango-limb"), n=1)
    producer = CountingProducer()
    drawn = RenderedPictures(plan, producer)
    drawn.warm_up()
    times = [scene.t_s for scene in producer.scenes]
    assert len(times) == WARM_UP_PICTURES
    assert times == sorted(times)
    assert times[-1] > 0.9 * plan.scenario.duration_s
    # and they change nothing in what is sent
    taken = drawn.take(wanted())
    assert taken.scene.t_s == pytest.approx(0.0, abs=1e-9)
    assert taken.scene.frame_index == 0
