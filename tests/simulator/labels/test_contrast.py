"""What the picture decides in labels: contrast about a keypoint, steps across the wireframe. Pictures made by hand."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.lens.camera_model import Camera, Distortion
from flyaround.simulator.imaging.image_formation import noise_sigma
from flyaround.simulator.labels.feasible import wireframe_step_share
from flyaround.simulator.labels.keypoints import radiometric_state
from flyaround.simulator.labels.wireframe import ProjectedEdge
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.targets.model import Edge

HEIGHT, WIDTH, LEVEL = 40, 60, 0.3
CAMERA = Camera(width_px=WIDTH, height_px=HEIGHT, fx_px=80.0, fy_px=80.0, cx_px=29.5, cy_px=19.5)


@pytest.fixture(scope="module")
def scene():
    return replace(plan_recipe("eval-black", 1, seed=3).scene(0), camera=CAMERA)


@pytest.fixture(scope="module")
def sigma(scene):
    return noise_sigma(scene.sensor, LEVEL, scene.exposure_s)


def flat(value=LEVEL):
    return np.full((HEIGHT, WIDTH), value, np.float32)


OFFSETS = [(x, y) for x, y in product(range(-3, 4), repeat=2) if max(abs(x), abs(y)) >= 2]


@pytest.mark.parametrize("at", [(20, 15), (2, 2), (WIDTH - 3, HEIGHT - 3)])
def test_contrast_about_a_keypoint_is_looked_for_in_five_by_five_pixels(scene, sigma, at):
    """One bright pixel is in sight within two pixels to every side, and out of it at three."""
    for dx, dy in OFFSETS:
        signal, x, y = flat(), at[0] + dx, at[1] + dy
        if not (0 <= x < WIDTH and 0 <= y < HEIGHT):
            continue
        signal[y, x] += 3 * sigma
        near = max(abs(dx), abs(dy)) <= 2
        for pixel in ((at[0] + 0.4, at[1] - 0.4), (at[0] - 0.4, at[1] + 0.4)):
            state = radiometric_state(scene, np.array(pixel), signal)
            assert state == ("visible" if near else "below_noise"), (dx, dy)


def test_patches_are_cut_by_the_picture_s_border_and_not_taken_from_the_other_side(scene, sigma):
    for x, y in ((0, 0), (WIDTH - 1, 0), (0, HEIGHT - 1), (WIDTH - 1, HEIGHT - 1)):
        signal = flat()
        inward = (x + (2 if x == 0 else -2), y + (2 if y == 0 else -2))
        signal[inward[1], inward[0]] += 3 * sigma
        assert radiometric_state(scene, np.array([x, y], float), signal) == "visible"
        other = flat()
        other[HEIGHT - 1 - y, WIDTH - 1 - x] += 3 * sigma
        assert radiometric_state(scene, np.array([x, y], float), other) == "below_noise"


def test_a_keypoint_is_saturated_when_all_of_its_patch_is(scene):
    full = flat(1.2)
    assert radiometric_state(scene, np.array([20.0, 15.0]), full) == "saturated"
    for dx, dy in ((-2, -2), (2, 2), (2, -2), (-2, 2), (0, 0)):
        one = full.copy()
        one[15 + dy, 20 + dx] = 0.2
        assert radiometric_state(scene, np.array([20.0, 15.0]), one) == "visible"


@pytest.mark.parametrize(("preset", "level"), [("speed", 0.3), ("thesis", 0.8), ("imx174", 0.8)])
def test_contrast_counts_from_one_sigma_of_the_noise_on(scene, preset, level):
    """Of the noise at that brightness: speckle and photons have more where there is more light."""
    scene = replace(scene, sensor=sensor_preset(preset))
    for steps, state in ((0.8, "below_noise"), (1.2, "visible")):
        signal = flat(level)
        signal[:, :20] += steps * noise_sigma(scene.sensor, level, scene.exposure_s)
        assert radiometric_state(scene, np.array([20.0, 15.0]), signal) == state


def visible_intervals(a, b):
    """An edge in sight from end to end [px]."""
    edge = Edge(name="edge", a_m=(0.0, 0.0, 0.0), b_m=(1.0, 0.0, 0.0))
    return ProjectedEdge(edge, np.array([a, b], float), np.ones(2), ((0.0, 1.0),))


WAYS = [
    ((30.0, 4.0), (30.0, 36.0)),
    ((8.0, 20.0), (52.0, 20.0)),
    ((10.0, 5.0), (38.0, 33.0)),
    ((38.0, 5.0), (10.0, 33.0)),
]


def across(way):
    """How far each pixel is from an edge, to its left positive [px]."""
    (ax, ay), (bx, by) = way
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return (-(x - ax) * (by - ay) + (y - ay) * (bx - ax)) / np.hypot(bx - ax, by - ay)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_step_is_taken_from_two_pixels_before_the_edge_to_two_behind_it(scene, sigma, way, sign):
    """A ramp of four pixels, of 1.4 sigma in all: half of it, one side alone, or half the reach would be too little."""
    ramp = np.clip(across(way) / 4, -0.5, 0.5)
    bright = (LEVEL + sign * 1.4 * sigma * ramp).astype(np.float32)
    assert wireframe_step_share(scene, [visible_intervals(*way)], bright, LEVEL) == 1.0
    faint = (LEVEL + sign * 0.9 * sigma * ramp).astype(np.float32)
    assert wireframe_step_share(scene, [visible_intervals(*way)], faint, LEVEL) == 0.0
    # a ramp twice as long shows half its height within reach
    long = (LEVEL + sign * 1.8 * sigma * np.clip(across(way) / 8, -0.5, 0.5)).astype(np.float32)
    assert wireframe_step_share(scene, [visible_intervals(*way)], long, LEVEL) == 0.0


@pytest.mark.parametrize("way", [((-0.5, 0.3), (20, 0.3)), ((-0.3, 0.3), (8, 0.3)), ((-0.7, 0.1), (0.3, 20))])
def test_a_step_is_taken_across_a_bent_edge_where_it_is_not_where_its_ends_are(scene, sigma, way):
    """An edge whose one end lies far outside the image, where the lens goes on in proportion to the radius."""
    width_px, height_px = 8 * WIDTH, 8 * HEIGHT
    lens = Camera(
        width_px=width_px,
        height_px=height_px,
        fx_px=320.0,
        fy_px=320.0,
        cx_px=239.5,
        cy_px=159.5,
        distortion=Distortion("brown_conrady", (-0.28, 0.04, 0.0, 0.0)),
    )
    scene = replace(scene, camera=lens)
    (ax, ay), (bx, by) = way
    ends = np.array([[ax, ay, 1.0], [bx, by, 1.0]])
    edge = Edge(name="edge", a_m=(0.0, 0.0, 0.0), b_m=(1.0, 0.0, 0.0))
    straight_px = ends[:, :2] * lens.fx_px + (lens.cx_px, lens.cy_px)
    view = ProjectedEdge(edge, lens.project(ends), np.ones(2), ((0.0, 1.0),), straight_px, lens)
    # how far from the edge a pixel is: that without the lens over how fast it grows on the image
    pixels = np.stack(np.mgrid[:height_px, :width_px][::-1], axis=-1).astype(float)
    aside = (lens.unproject(pixels) - (ax, ay)) @ np.array([ay - by, bx - ax])
    ramp = np.clip(aside / np.hypot(*np.gradient(aside)), -4, 4) / 4
    shares = [
        wireframe_step_share(scene, [view], (LEVEL + sigmas * sigma * ramp).astype(np.float32), LEVEL)
        for sigmas in (1.02, 0.98)
    ]
    # but where the edge leaves the image: a side is beyond its border there
    assert shares == [pytest.approx(1.0, abs=0.05), 0.0]


@pytest.mark.parametrize("way", WAYS)
def test_a_bright_line_on_the_edge_is_no_step(scene, sigma, way):
    """Both sides are as bright: seen from the line itself either would be a step."""
    line = (LEVEL + 5 * sigma * np.clip(1.5 - np.abs(across(way)), 0, 1)).astype(np.float32)
    assert wireframe_step_share(scene, [visible_intervals(*way)], line, LEVEL) == 0.0


def test_the_share_is_one_of_length(scene, sigma):
    """A quarter of an edge of 40 pixels shows a step; samples are four pixels long."""
    way = ((10.0, 20.0), (50.0, 20.0))
    signal = flat()
    signal[20:, :20] += 5 * sigma
    share = wireframe_step_share(scene, [visible_intervals(*way)], signal, LEVEL)
    assert share == pytest.approx(0.25, abs=0.051)
    both = [visible_intervals(*way), visible_intervals((10.0, 5.0), (50.0, 5.0))]
    assert wireframe_step_share(scene, both, signal, LEVEL) == pytest.approx(share / 2, abs=1e-9)
