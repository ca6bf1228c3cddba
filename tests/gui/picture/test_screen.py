"""What the console says of a picture's exposure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scene_kit import build_scene, build_target, plate, white

from flyaround.gui.picture.screen import exposure_fault, screen_picture
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.frame import NO_RADIANCE, Frame

TARGET = build_target([plate("plate", "white", (0.0, 0.0, 0.0), 0.5)], [white()])


def picture_of(level: int, *, sunlit: float = 1.0) -> Frame:
    scene = replace(build_scene(TARGET), sensor=sensor_preset("ideal"), sun_visible_fraction=sunlit)
    size = (scene.camera.height_px, scene.camera.width_px)
    return Frame(scene, np.full(size, level, np.uint8), NO_RADIANCE)


@pytest.mark.parametrize(
    ("level", "sunlit", "words"),
    [(255, 1.0, "burnt out at"), (2, 1.0, "dark at"), (2, 0.0, "in the shadow of the Earth"), (90, 1.0, "")],
)
def test_a_picture_that_shows_nothing_says_why(level: int, sunlit: float, words: str) -> None:
    said = exposure_fault(picture_of(level, sunlit=sunlit))
    assert words in said
    assert bool(said) == bool(words)


def test_raw_numbers_are_shown_as_they_are() -> None:
    frame = picture_of(90)
    assert screen_picture(frame, raw=True).max() == 90
    assert screen_picture(frame).max() > 120
