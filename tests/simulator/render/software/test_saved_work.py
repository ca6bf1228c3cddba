"""What the passes leave out shows nowhere: triangles that look away, tiles that the craft does not touch."""

import ctypes
from dataclasses import replace

import cv2
import moderngl
import numpy as np
import pytest

from flyaround.simulator.bench.scenes import bench_scenes
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.render.craft import resident_targets
from flyaround.simulator.render.craft import visible_triangles as culling
from flyaround.simulator.render.craft.viewport_fit import TILE_PX, all_tiles
from flyaround.simulator.render.gl.depth_buffer import MOST_RANGES
from flyaround.simulator.render.gl.library import gl_library
from flyaround.simulator.render.gl.mipmaps import mipmap_chain, mipmapped_texture, release_mipmapped
from flyaround.simulator.render.globe.globe_view import globe_view
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.render.software import quad_packing, software_path
from flyaround.simulator.render.software.tiles import earth_tiles
from flyaround.simulator.render.view import build_view
from flyaround.simulator.runtime.cached_arrays import cached_array
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.illumination.atmosphere import earth_atmosphere
from flyaround.simulator.targets.library import load_target

pytestmark = pytest.mark.gl
SOFTWARE_PATH = True

POSES = (
    ((0.1, -0.05, 4.0), (0.3, 0.4, 0.2)),
    ((1.05, 0.62, 4.0), (1.3, -0.8, 2.2)),  # half outside the image
    ((0.0, 0.0, 30.0), (-2.0, 0.5, 0.1)),
)


@pytest.mark.parametrize(("t_m", "rotvec_rad"), POSES)
def test_triangles_and_tiles_left_out_change_no_pixel(renderer, draw_kit, t_m, rotvec_rad, monkeypatch):
    tango = load_target("tango")
    scene = draw_kit.scene(tango, t_m=t_m, rotvec_rad=rotvec_rad, sun_camera=(0.5, -0.4, -0.6))
    lean = renderer.render(scene, tango, labels=True)
    counts = []

    def all_triangles(mesh, place):
        counts.append(len(mesh.triangles) / len(visible(mesh, place)))
        return mesh.triangles

    visible = culling.visible_triangles
    monkeypatch.setattr(culling, "visible_triangles", all_triangles)
    whole = renderer.render(scene, tango, labels=True)
    assert min(counts) > 1.5
    assert np.abs(whole.radiance - lean.radiance).max() < 1e-4 * whole.radiance.max()
    assert np.array_equal(whole.coverage, lean.coverage)
    # every tile of the rectangle, on the same lattice's window
    tiles = []
    target_tiles = software_path.TileCulling.target_tiles
    monkeypatch.setattr(
        software_path.TileCulling,
        "target_tiles",
        lambda *a: tiles.append(target_tiles(*a)) or all_tiles(a[1].rect),
    )
    everywhere = renderer.render(scene, tango, labels=True)
    outside = everywhere.coverage.copy()
    for x, y in tiles[0] - (TILE_PX - 1) / 2:
        outside[round(y) : round(y) + TILE_PX, round(x) : round(x) + TILE_PX] = 0
    assert everywhere.coverage.max() == 1
    assert outside.max() == 0


def test_samples_of_earlier_frames_never_show(renderer, draw_kit):
    # the samples' image is not cleared: a stamp tells its frames apart, until all stamps are used
    tango = load_target("tango")
    camera = Camera(width_px=96, height_px=80, fx_px=200.0, fy_px=200.0, cx_px=47.5, cy_px=39.5)
    turns = [(0.4 * k, 0.3 * k, 0.2) for k in range(MOST_RANGES + 4)]
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


@pytest.mark.parametrize(("off_nadir_deg", "bands"), [(20.0, "mono"), (62.0, "mono"), (62.0, "rgb")])
def test_pixels_drawn_by_quads_are_those_drawn_one_by_one(
    renderer, draw_kit, off_nadir_deg, bands, monkeypatch
):
    tango = load_target("tango")
    camera = Camera(width_px=192, height_px=160, fx_px=480.0, fy_px=480.0, cx_px=95.5, cy_px=79.5)
    scene = draw_kit.scene(
        tango,
        t_m=(0.4, 0.1, 12.0),
        camera=camera,
        latitude_deg=30,
        off_nadir_deg=off_nadir_deg,
        sun_camera=(0.3, -0.2, -1),
        environment=Environment(),
    )
    scene = replace(scene, bands=bands)
    quads = renderer.render(scene, tango, labels=True)
    assert "earth.quad_packing" in quads.stage_ms
    monkeypatch.setattr(quad_packing, "LEAST_SHARE", 2.0)
    singles = renderer.render(scene, tango, labels=True)
    assert "earth.quad_packing" not in singles.stage_ms
    view = build_view(scene)
    earth = globe_view(view, camera, earth_atmosphere(bands))
    tiles = earth_tiles(earth, camera, None, scene.epoch_utc)
    copied = np.zeros((160, 192), bool)
    for x, y in tiles.others_px + 0.5 - tiles.size_px / 2:
        copied[round(y) : round(y) + tiles.size_px, round(x) : round(x) + tiles.size_px] = True
    assert (copied.sum() > 0) == (off_nadir_deg > 60)
    assert copied.sum() < 0.6 * copied.size
    # nor does what lies behind the target come into it
    copied |= singles.coverage == 1
    assert np.array_equal(quads.radiance[copied], singles.radiance[copied])
    # the map has 256 steps, which thin clouds and coasts enlarge: few pixels are off by more than one step's worth
    off = np.abs(quads.radiance - singles.radiance)[~copied]
    assert off.max() > 0
    assert np.median(off) < 0.005 * singles.radiance.mean()
    assert np.sqrt(np.mean(off**2)) < 0.03 * singles.radiance.mean()
    assert quads.radiance.mean() == pytest.approx(singles.radiance.mean(), rel=1e-3)


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


def test_levels_of_a_kept_map_are_means_of_four_texels(renderer, tmp_path, monkeypatch):
    monkeypatch.setenv("FLYAROUND_CACHE_DIR", str(tmp_path))
    made = np.random.default_rng(1).integers(0, 256, (38, 100, 4), np.uint8)
    image = cached_array("map", lambda: made)
    texture = mipmapped_texture(renderer.device.context, mipmap_chain(image, globe=False))
    renderer.device.check("uploading levels")
    kept = sorted(path.name for path in tmp_path.iterdir())
    assert len(kept) == 2
    assert kept[0].startswith("map-levels-")
    texture.use(0)
    library = gl_library()
    for level, (w, h) in ((1, (50, 19)), (6, (1, 1))):
        found = np.zeros((h, w, 4), np.uint8)
        library.glGetTexImage(0x0DE1, level, 0x1908, 0x1401, ctypes.c_void_p(found.ctypes.data))
        means = cv2.resize(made.astype(np.float32), (w, h), interpolation=cv2.INTER_AREA)
        # each level is rounded anew
        assert np.abs(found - means).max() <= (1 if level == 1 else 6)
    assert renderer.device.context.error == "GL_NO_ERROR"
    release_mipmapped(texture)


def test_few_targets_stay_on_the_gpu_and_come_back_the_same(draw_kit, monkeypatch):
    made, upload = [], resident_targets.upload
    monkeypatch.setattr(resident_targets, "MOST_LOADED", 2)
    monkeypatch.setattr(resident_targets, "upload", lambda *a: made.append(upload(*a)) or made[-1])
    targets = [
        draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), half)], [draw_kit.white()])
        for half in (0.2, 0.3, 0.4)
    ]
    with Renderer() as own:
        drawn = [
            own.render(draw_kit.scene(targets[k]), targets[k], labels=True).radiance
            for k in (0, 1, 0, 2, 0, 1)
        ]
        gone = [isinstance(mesh.vertices.mglo, moderngl.InvalidObject) for mesh in made]
    assert gone == [False, True, True, False]
    assert np.array_equal(drawn[0], drawn[4])
    assert np.array_equal(drawn[1], drawn[5])
    assert drawn[0].sum() < drawn[1].sum() < drawn[3].sum()
