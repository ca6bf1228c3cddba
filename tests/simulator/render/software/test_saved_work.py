"""Culling of back faces and empty tiles does not change the image."""

import cv2
import numpy as np
import pytest

from flyaround.simulator.bench.scenes import bench_scenes
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.render.gl.depth_buffer import MAX_RANGES
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.targets.library import load_target

pytestmark = pytest.mark.gl
SOFTWARE_PATH = True


def test_samples_of_earlier_frames_never_show(renderer, draw_kit):
    # the samples' image is not cleared: a stamp tells its frames apart, until all stamps are used
    tango = load_target("tango")
    camera = Camera(width_px=96, height_px=80, fx_px=200.0, fy_px=200.0, cx_px=47.5, cy_px=39.5)
    turns = [(0.4 * k, 0.3 * k, 0.2) for k in range(MAX_RANGES + 4)]
    scenes = [draw_kit.scene(tango, t_m=(0.0, 0.0, 5.0), rotvec_rad=turn, camera=camera) for turn in turns]
    first = [renderer.render(scene, tango, labels=True) for scene in scenes]
    for k in reversed(range(len(scenes))):
        again = renderer.render(scenes[k], tango, labels=True)
        assert np.array_equal(again.radiance, first[k].radiance)
        # where the craft's surface lies at the pixel's centre and nowhere far from it
        near = cv2.dilate(np.isfinite(again.depth_m).astype(np.uint8), np.ones((3, 3), np.uint8))
        assert again.coverage[near == 0].max() < 0.5
        assert again.coverage.max() == 1


def test_what_the_near_plane_cuts_is_drawn_alike_whatever_was_drawn_before(renderer, draw_kit):
    # its depths are not clamped to their frame's range, so the samples are cleared each time
    tango = load_target("tango")
    camera = Camera(width_px=96, height_px=80, fx_px=60.0, fy_px=60.0, cx_px=47.5, cy_px=39.5)
    cut = draw_kit.scene(tango, t_m=(0.1, 0.45, 0.35), rotvec_rad=(0.3, 0.2, 0.1), camera=camera)
    others = [
        draw_kit.scene(tango, t_m=(0.0, 0.0, z), rotvec_rad=(z, 0.0, 0.2), camera=camera) for z in (2.0, 1.2)
    ]
    first = renderer.render(cut, tango, labels=True)
    assert 0.1 < np.mean(first.coverage > 0) < 1
    # the label raster, which has depths of its own, sees the craft in the same pixels
    inside = cv2.erode(np.isfinite(first.depth_m).astype(np.uint8), np.ones((3, 3), np.uint8))
    assert np.mean(first.coverage[inside > 0] > 0.99) > 0.99
    for other in others:
        renderer.render(other, tango)
        assert np.array_equal(renderer.render(cut, tango, labels=True).radiance, first.radiance)


def test_no_light_is_negative_by_night(renderer, draw_kit):
    # the map's slope is carried on from texel to texel, also past dark countries' ends
    tango = load_target("tango")
    scene = draw_kit.scene(
        tango, t_m=(0.4, 0.1, 12.0), latitude_deg=45, sun_camera=(0.3, -0.2, 1), environment=Environment()
    )
    drawn = renderer.render(scene, tango)
    assert "earth.quad_packing" in drawn.stage_ms
    assert drawn.radiance.min() >= 0
    assert drawn.radiance.max() > 0


@pytest.mark.slow
def test_the_bench_times_frames_without_waits_and_passes_apart(draw_kit):
    machine, (cost,) = bench_scenes(("tango-space-10m",), n_frames=3)
    passes = cost.passes_ms_p50
    own = sum(ms for name, ms in passes.items() if name.startswith("render."))
    assert machine.threads > 0
    assert cost.reference_ms > 0.1  # an H100 takes 0.8 ms
    # each pass is waited for: their times add up to the drawing of the same frames
    assert own == pytest.approx(passes["render"], rel=0.2)
    assert cost.frame_ms_p50 == pytest.approx(cost.render_ms_p50 + cost.sensor_ms_p50, rel=0.1)
