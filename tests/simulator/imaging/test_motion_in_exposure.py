"""Motion during the exposure: smear of an edge, shear by a rolling shutter, star trails, against what they must be."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from flyaround.simulator.camera.detector.shutter import Shutter
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.check.verify import check_dataset
from flyaround.simulator.dataset.formats.native import frame_paths, read_png
from flyaround.simulator.dataset.single_frames import render_scene
from flyaround.simulator.imaging.exposure import MAX_INSTANTS, instants, integrate
from flyaround.simulator.imaging.image_motion import image_motion_px
from flyaround.simulator.imaging.rolling_shutter import row_bands
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.render.sky.star_pass import stars_in_view
from flyaround.simulator.render.view import build_view
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.scene.motion import propagated_scene
from flyaround.simulator.world.frames.rotation import matrix_from_quat, rotation_angle_rad

pytestmark = pytest.mark.gl

Z_M = 5.0


@pytest.fixture
def plate(draw_kit):
    """A square that fills the middle of the image, its left edge at x = 0 of the camera."""
    return draw_kit.target([draw_kit.plate("plate", "white", (0.4, 0.0, 0.0), 0.4)], [draw_kit.white()])


def _moving(draw_kit, target, v_camera_m_s=(0.0, 0.0, 0.0), **changes):
    scene = draw_kit.scene(target, t_m=(0.0, 0.0, Z_M), quality="high", **changes)
    R = matrix_from_quat(scene.q_camera_from_eci_wxyz)
    return replace(scene, v_target_eci_m_s=vec3(R.T @ np.asarray(v_camera_m_s, float)))


def _edge(row):
    """Centre and variance [px2] of the spread of an edge from dark to light along a row."""
    spread = np.diff(row.astype(float))
    at = np.arange(len(spread)) + 0.5
    spread = np.where(np.abs(at - len(spread) / 2) < 40, spread, 0)
    # what is left of a flat plate's shading must not count with the square of its distance
    spread = np.where(spread > 0.01 * spread.max(), spread, 0)
    center = (at * spread).sum() / spread.sum()
    return center, ((at - center) ** 2 * spread).sum() / spread.sum()


@pytest.mark.parametrize("speed_m_s", [4.0, -8.0])
def test_the_smear_of_a_moving_edge_is_as_long_as_its_way(renderer, draw_kit, plate, speed_m_s):
    scene = replace(_moving(draw_kit, plate, (speed_m_s, 0, 0)), exposure_s=0.04)
    radiance = integrate(renderer, scene, plate).radiance
    row = round(scene.camera.cy_px)
    still = renderer.render(scene, plate).radiance
    # a pixel's own width, and the way of the edge: variances of boxes add up
    smear_px = np.sqrt(12 * (_edge(radiance[row])[1] - _edge(still[row])[1]))
    way_px = abs(speed_m_s) * scene.exposure_s * scene.camera.fx_px / Z_M
    assert smear_px == pytest.approx(way_px, rel=0.01)
    assert _edge(radiance[row])[0] == pytest.approx(_edge(still[row])[0], abs=0.05)
    # light is neither lost nor made
    assert radiance.mean() == pytest.approx(still.mean(), rel=2e-3)


def test_a_spinning_edge_smears_with_its_radius(renderer, draw_kit, plate):
    rate = 3.0
    scene = replace(_moving(draw_kit, plate), omega_target_rad_s=(0.0, 0.0, rate), exposure_s=0.1)
    radiance, still = integrate(renderer, scene, plate).radiance, renderer.render(scene, plate).radiance
    for offset in (-40, -25, 25, 40):
        row = round(scene.camera.cy_px) + offset
        radius_px = abs(row - scene.camera.cy_px) * scene.camera.fx_px / scene.camera.fy_px
        smear_px = np.sqrt(12 * (_edge(radiance[row])[1] - _edge(still[row])[1]))
        # the edge meets a row at radius x tan(angle)
        way_px = 2 * radius_px * np.tan(rate * scene.exposure_s / 2)
        assert smear_px == pytest.approx(way_px, rel=0.01)


def test_a_rolling_shutter_shears_a_moving_edge(renderer, draw_kit, plate):
    speed, readout = 3.0, 0.05
    shutter = Shutter(kind="rolling", readout_s=readout, motion_blur=False)
    scene = replace(_moving(draw_kit, plate, (speed, 0, 0)), shutter=shutter)
    radiance = integrate(renderer, scene, plate).radiance
    height, cy = scene.camera.height_px, scene.camera.cy_px
    rows = np.arange(round(cy) - 40, round(cy) + 41)
    slope = np.polyfit(rows, [_edge(radiance[row])[0] for row in rows], 1)[0]
    assert slope == pytest.approx(speed * scene.camera.fx_px / Z_M * readout / height, rel=0.01)


def test_a_rolling_shutter_bends_a_spinning_edge(renderer, draw_kit, plate):
    rate, readout = 8.0, 0.2
    shutter = Shutter(kind="rolling", readout_s=readout, motion_blur=False)
    scene = replace(_moving(draw_kit, plate), omega_target_rad_s=(0.0, 0.0, rate), shutter=shutter)
    radiance = integrate(renderer, scene, plate).radiance
    c = scene.camera
    rows = np.arange(round(c.cy_px) - 40, round(c.cy_px) + 41)
    found = np.array([_edge(radiance[row])[0] for row in rows])
    time = (rows - (c.height_px - 1) / 2) * readout / c.height_px
    # x right, y down: a positive turn about the boresight carries what is below to the left
    expected = c.cx_px - (rows - c.cy_px) * c.fx_px / c.fy_px * np.tan(rate * time)
    shear = np.polyfit(expected, found, 1)[0]
    assert np.ptp(expected) > 10
    assert shear == pytest.approx(1, abs=0.01)
    assert np.abs(found - expected).max() < 0.15


def test_stars_draw_trails_as_long_as_the_camera_turns(renderer, draw_kit, plate):
    speck = draw_kit.target([draw_kit.plate("speck", "white", (0, 0, -50.0), 0.001)], [draw_kit.white()])
    sky = msgspec.structs.replace(draw_kit.nothing, stars=True)
    still = draw_kit.scene(speck, t_m=(0, 0, Z_M), off_nadir_deg=150.0, environment=sky)
    pixels, light = stars_in_view(still, build_view(still), None, None)[:2]
    size = np.array([still.camera.width_px, still.camera.height_px])
    inner = np.all((pixels > 60) & (pixels < size - 60), axis=1)
    star = np.flatnonzero(inner)[np.argmax(light[inner].sum(axis=1))]
    rate = 0.2
    turning = replace(still, omega_camera_rad_s=(0.0, rate, 0.0), exposure_s=0.5)
    radiance = integrate(renderer, turning, speck).radiance.astype(float)
    u, v = pixels[star]
    trail = radiance[round(v) - 2 : round(v) + 3].sum(axis=0)
    # the camera turns to the right: a star comes from the right and leaves to the left
    x = (u - still.camera.cx_px) / still.camera.fx_px
    angles = np.arctan(x) + np.array([-0.5, 0.5]) * rate * turning.exposure_s
    first, last = still.camera.fx_px * np.tan(angles) + still.camera.cx_px
    inside = trail[round(first) + 3 : round(last) - 2]
    half = np.median(inside) / 2  # other stars are fainter by far
    left = np.interp(
        half, trail[round(first) - 2 : round(first) + 3], np.arange(round(first) - 2, round(first) + 3)
    )
    right = np.interp(
        -half, -trail[round(last) - 2 : round(last) + 3], np.arange(round(last) - 2, round(last) + 3)
    )
    assert last - first > 50
    assert right - left == pytest.approx(last - first, rel=0.01)
    assert 2 * half * (last - first) == pytest.approx(light[star].sum(), rel=0.06)


def test_what_stands_still_is_drawn_once(renderer, draw_kit, plate):
    scene = _moving(draw_kit, plate)
    assert integrate(renderer, scene, plate).n_drawn == 1
    slow = replace(scene, omega_target_rad_s=(0.0, 0.0, 0.5))
    assert image_motion_px(slow, plate, slow.exposure_s) < 0.3
    assert np.array_equal(integrate(renderer, slow, plate).radiance, renderer.render(slow, plate).radiance)
    frozen = replace(_moving(draw_kit, plate, (50.0, 0, 0)), shutter=Shutter(motion_blur=False))
    assert len(instants(frozen, plate)) == 1
    assert len(instants(replace(frozen, shutter=Shutter(), exposure_s=10.0), plate)) == MAX_INSTANTS


def test_the_scene_a_moment_later_is_the_propagated_one():
    plan = plan_flight(load_scenario("tango-flyaround"), times=(30.0,))
    scene = plan.scene(0)
    for dt in (-0.1, 0.02, 0.1):
        guess = propagated_scene(scene, dt)
        state = plan.flight.state(30.0 + dt)
        true = plan.scene_of(state, 0)
        assert rotation_angle_rad(guess.q_camera_from_target_wxyz, true.q_camera_from_target_wxyz) < 1e-5
        shift = np.subtract(guess.t_camera_from_target_m, true.t_camera_from_target_m)
        assert np.abs(shift).max() < 5e-5
        assert rotation_angle_rad(*(s.central.q_fixed_from_eci_wxyz for s in (guess, true))) < 1e-9
        assert np.abs(np.subtract(guess.r_camera_eci_m, true.r_camera_eci_m)).max() < 1e-3
        assert np.allclose(guess.v_target_camera_m_s, true.v_target_camera_m_s, atol=1e-3)


@pytest.fixture(scope="module")
def rolling_plan():
    scenario = load_scenario("tango-flyaround")
    sensor = msgspec.structs.replace(
        scenario.sensor, shutter="rolling", readout_s=0.8, exposure_s=0.2, full_scale_j_m2_sr=20.0
    )
    attitude = msgspec.structs.replace(scenario.attitude, rate_deg_s=(6.0, -10.0, 17.0))
    scenario = msgspec.structs.replace(scenario, sensor=sensor, attitude=attitude, target="tango@low")
    plan = plan_flight(scenario, times=(20.0,), quality="draft")
    camera = plan.camera.resized(96)
    # below the middle, so that all of it is seen late
    return replace(plan, camera=replace(camera, cy_px=camera.cy_px + 14))


def test_labels_of_a_rolling_shutter_with_motion_blur_pass_the_check(rolling_plan, tmp_path):
    layers = ("amodal", "parts", "depth", "normals", "clean", "wireframe")
    summary = capture(rolling_plan, tmp_path / "set", labels=layers)
    assert summary.quarantined == ()
    report = check_dataset(tmp_path / "set")
    assert report.faults == ()
    truth = read_truth(frame_paths(tmp_path / "set", 0).truth)
    assert len(truth.row_poses) == 33
    scene, target = rolling_plan.scene(0), rolling_plan.target
    assert len(row_bands(scene, target)) > 10
    assert len(instants(scene, target)) == 2
    # the labels follow the rows: those of one instant are somewhere else
    stopped = replace(truth.scene, shutter=Shutter(motion_blur=False))
    frame = render_scene(stopped, rolling_plan.target)
    moved = [
        np.hypot(*np.subtract(a.pixel_px, b.pixel_px))
        for a, b in zip(truth.keypoints, frame.truth.keypoints, strict=True)
    ]
    assert max(moved) > 0.8
    # and the record alone gives the same bytes
    again = render_scene(truth.scene, rolling_plan.target)
    assert np.array_equal(again.image, read_png(frame_paths(tmp_path / "set", 0).image))
