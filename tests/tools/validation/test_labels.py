"""The proof of labels in small: a few random frames, right as drawn, and caught when spoilt."""

from functools import cache

import pytest

from flyaround.simulator.frame import take_frame
from tools.validation.labels.faults import FAULTS, inject_fault
from tools.validation.labels.frames import cached_target, random_frame
from tools.validation.labels.report import _check, check_one, dataset_card, page, summary

pytestmark = pytest.mark.gl

CHEAP = ("cubesat-1u@low", "cubesat-3u@low", "tango-thesis@low")


@cache
def _cheap_frames():
    found = (k for k in range(300) if random_frame(3, k)[0].target.name in CHEAP)
    return [next(found) for _ in range(12)]


def test_random_frames_are_right_and_the_same_again(renderer):
    frames = _cheap_frames()[:3]
    lines = [check_one(renderer, 3, k) for k in frames]
    assert [line["faults"] for line in lines] == [[], [], []]
    assert random_frame(3, frames[1]) == random_frame(3, frames[1])
    assert random_frame(3, frames[1])[0] != random_frame(4, frames[1])[0]
    found = summary(lines)
    assert (found["frames"], found["wrong_frames"]) == (3, 0)
    assert "| frames with a wrong label | 0 |" in page(found, 3)


@pytest.mark.slow
def test_every_way_of_spoiling_is_caught(renderer):
    tried = set()
    for k in _cheap_frames():
        scene, request = random_frame(3, k)
        left = [kind for kind in FAULTS if kind not in tried]
        if scene.shutter.is_rolling or not left:
            continue
        frame = take_frame(renderer, scene, cached_target(scene.target.name), labels=request)
        card = dataset_card(renderer, frame, 3)
        for kind in left:
            spoilt = inject_fault(kind, frame)
            if spoilt is not None:
                tried.add(kind)
                assert _check(k, spoilt, card), kind
    assert len(tried) >= len(FAULTS) - 2


@pytest.mark.parametrize("k", [6006, 9405, 9447])
def test_a_point_hidden_by_less_than_a_pixel_is_asked_of_a_ray(renderer, k):
    # wings seen edge-on, and a rail's end through a steep lens: the depths of the pixels about the point do not tell
    assert check_one(renderer, 1, k)["faults"] == []


@pytest.mark.slow
def test_steps_of_a_picture_with_one_band_burnt_out_are_those_of_its_pixels(renderer):
    # three bands, of which one is far beyond the scale: the mean is of what the pixels keep
    assert check_one(renderer, 1, 124)["faults"] == []
