"""Labels as pictures: colours mean what the scale says, every class has its own, a view without a target says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flyaround.gui.picture.label_images import (
    LABELS,
    OFF_RGB,
    PART_COLOURS,
    STATE_COLOURS,
    close_up,
    depth_colours,
    depth_picture,
    part_picture,
    round_ticks,
)
from flyaround.simulator.camera.lens.camera_model import reduced_camera
from flyaround.simulator.frame import Frame, take_frame
from flyaround.simulator.labels.part_classes import PART_CLASSES
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario


@pytest.fixture(scope="module")
def frame() -> Frame:
    session = FlightSession.of(load_scenario("tango-space-10m"))
    scene = session.scene()
    scene = replace(scene, camera=reduced_camera(scene.camera, 4), quality="draft")
    with Renderer() as renderer:
        return take_frame(renderer, scene, session.plan.target, labels=LABELS)


def test_depth_runs_from_bright_to_dark() -> None:
    depth = np.full((4, 6), np.nan, np.float32)
    depth[1, 1:5] = [5.0, 6.0, 7.0, 8.0]
    picture = depth_picture(depth)
    assert picture is not None
    assert (picture.near_m, picture.far_m) == (5.0, 8.0)
    brightness = picture.image.astype(int).sum(axis=2)
    assert np.all(np.diff(brightness[1, 1:5]) < 0)
    assert tuple(picture.image[0, 0]) == OFF_RGB
    assert all(picture.near_m <= t <= picture.far_m for t in picture.ticks_m)


def test_depth_colours_rise_evenly_in_brightness() -> None:
    light = depth_colours().astype(float) @ np.array([0.2126, 0.7152, 0.0722])
    assert np.all(np.diff(light[::8]) < 0)


def test_no_target_no_depth_picture() -> None:
    assert depth_picture(np.full((3, 3), np.nan, np.float32)) is None


def test_a_face_across_the_boresight_is_one_colour() -> None:
    picture = depth_picture(np.full((3, 3), 10.0, np.float32))
    assert picture is not None
    assert len(np.unique(picture.image.reshape(-1, 3), axis=0)) == 1


@pytest.mark.parametrize(("low", "high"), [(9.5, 10.7), (0.0, 1000.0), (3.001, 3.004), (100.0, 103.0)])
def test_ticks_are_round_and_few(low: float, high: float) -> None:
    ticks = round_ticks(low, high)
    assert 1 <= len(ticks) <= 5
    assert all(low - 1e-6 <= t <= high + 1e-6 for t in ticks)


def test_parts_have_the_colour_of_their_class(frame: Frame) -> None:
    made = part_picture(frame)
    assert made is not None
    image, classes = made
    assert {"body", "solar_array"} <= set(classes)
    assert frame.mask is not None
    # off the target the picture is dark and grey
    off = image[frame.mask == 0]
    assert np.all(off == off[:, :1])
    on = image[frame.mask > 0]
    assert np.any(on[:, 2].astype(int) > on[:, 0].astype(int) + 40), "no solar array in blue"


def test_a_close_up_holds_the_target_and_has_the_pictures_form(frame: Frame) -> None:
    rows, columns = close_up(frame)
    assert frame.mask is not None
    assert frame.mask[rows, columns].sum() == frame.mask.sum()
    height, width = frame.image.shape[:2]
    assert columns.stop - columns.start < 0.6 * width
    form = (columns.stop - columns.start) / (rows.stop - rows.start)
    assert form == pytest.approx(width / height, rel=0.05)
    whole = close_up(replace(frame, truth=None))
    assert frame.image[whole].shape == frame.image.shape


def test_every_class_and_state_has_a_colour_of_its_own() -> None:
    assert set(PART_COLOURS) == set(PART_CLASSES)
    assert len(set(PART_COLOURS.values())) == len(PART_CLASSES)
    assert len(set(STATE_COLOURS.values())) == len(STATE_COLOURS)
