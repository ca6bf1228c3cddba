"""The renderer's parts on their own: sampling lattice, uniform layout, shader text, tiles, noise, cache."""

import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.celestial.detail_noise import detail_texture
from flyaround.simulator.render.craft.viewport_fit import PATTERNS as PRESETS
from flyaround.simulator.render.craft.viewport_fit import TINY_PATTERN, all_tiles
from flyaround.simulator.render.gl.programs import ProgramLibrary, read_source
from flyaround.simulator.render.gl.shared_blocks import FRAME, GLOBE, MATERIALS, TARGET
from flyaround.simulator.render.gl.uniform_block import Field, UniformBlock
from flyaround.simulator.render.globe.globe_view import globe_view
from flyaround.simulator.render.projection import PixelRect
from flyaround.simulator.render.software import tiles
from flyaround.simulator.render.view import build_view
from flyaround.simulator.runtime import cached_arrays as cache
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.illumination.atmosphere import (
    earth_atmosphere,
    ground_irradiance,
    optical_depth_to_top,
)

PATTERNS = {lattice for choices in PRESETS.values() for lattice, _ in choices} | {TINY_PATTERN}
SOFTWARE_PATH = True


@pytest.mark.parametrize("lattice", sorted(PATTERNS, key=str), ids=lambda lattice: f"{lattice.samples}")
def test_lattice_repeats_with_the_pixels_and_is_n_rooks(lattice):
    points = np.array([(x, y) for _, _, x, y in lattice.offsets()])
    n = lattice.samples
    assert len(points) == n
    assert np.abs(points.mean(axis=0)).max() < 1e-12
    for axis in points.T:
        # one sample in each of n columns, and of n rows
        assert np.array_equal(np.sort(np.floor((axis + 0.5) * n + 1e-9)), np.arange(n))
    to_buffer = lattice.buffer_from_pixel((0, 0))
    own = np.array([lattice.s, lattice.t]) @ (7, 5)
    for i, j, x, y in lattice.offsets():
        assert to_buffer @ [7 + x, 5 + y, 1] == pytest.approx(own + np.array([i, j]) + 0.5)


@pytest.mark.parametrize("lattice", sorted(PATTERNS, key=str), ids=lambda lattice: f"{lattice.samples}")
def test_lattice_window_holds_every_sample(lattice):
    (width, height), origin = lattice.window(np.array([[13.0, 21.0]]), 3.0)
    for x in (10, 16):
        for y in (20, 22):
            for i, j, _, _ in lattice.offsets():
                s, t = np.array([lattice.s, lattice.t]) @ (x, y) + (i, j) - origin
                assert 0 <= s < width
                assert 0 <= t < height


@pytest.mark.gl
def test_block_layout_is_the_drivers(renderer):
    context = renderer.device.context
    for number, fields in enumerate(
        (FRAME, TARGET, MATERIALS, GLOBE, (Field("float", "a"), Field("vec3", "b")))
    ):
        block = UniformBlock(context, "Probe", 7, fields)
        array = [f.name for f in fields if f.count]
        uses = "+".join(
            f"{f.name}[1].x"
            if f.count
            else {"float": f.name, "mat4": f"{f.name}[1].x"}.get(f.glsl_type, f"{f.name}.x")
            for f in fields
        )
        program = context.program(
            vertex_shader="#version 410 core\nvoid main() { gl_Position = vec4(0.0); }",
            fragment_shader=f"#version 410 core\n{block.glsl}out vec4 o; void main() {{ o = vec4({uses}); }}",
        )
        assert program["Probe"].size == block.dtype.itemsize, (number, array)


@pytest.mark.gl
def test_a_missing_or_unknown_member_is_an_error(renderer):
    block = UniformBlock(renderer.device.context, "Probe", 7, (Field("vec4", "one"), Field("vec4", "two")))
    with pytest.raises(KeyError, match="two"):
        block.write({"one": [0, 0, 0, 0]})
    with pytest.raises(KeyError, match="three"):
        block.write({"one": [0] * 4, "two": [0] * 4, "three": [0] * 4})


@pytest.mark.gl
def test_setting_a_uniform_that_is_not_used_is_nothing(renderer):
    library = ProgramLibrary(renderer.device.context, ())
    program = library.get("common/full_screen.vert", "craft/shadow.frag", {})
    program.set("u_removed_by_the_compiler", 3.0)
    assert library.get("common/full_screen.vert", "craft/shadow.frag", {}) is program


def test_includes_are_expanded_once():
    text = read_source("earth/earth.frag")
    assert "#include" not in text
    assert text.count("float rayleigh_phase(") == 1


@pytest.mark.gl
def test_interpolated_tiles_differ_little_from_the_exact_ones(renderer, draw_kit, monkeypatch):
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])
    environment = Environment(stars=False, sun=False, clouds=False)
    scene = draw_kit.scene(
        target,
        t_m=(0, 0, -50),
        latitude_deg=20,
        off_nadir_deg=30,
        sun_camera=(0.3, -0.2, -1),
        environment=environment,
    )
    quick = renderer.render(scene, target).radiance
    monkeypatch.setattr(tiles, "_SMOOTH_DISC", 2.0)
    exact = renderer.render(scene, target).radiance
    assert not np.array_equal(quick, exact)
    assert np.sqrt(np.mean((quick - exact) ** 2)) < 0.02 * exact.mean()


def test_tiles_cover_what_the_earth_touches_once(draw_kit):
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])
    camera = Camera(width_px=200, height_px=150, fx_px=400.0, fy_px=400.0, cx_px=99.5, cy_px=74.5)
    for off_nadir, full in ((0.0, True), (68.0, False), (180.0, False)):
        view = build_view(draw_kit.scene(target, camera=camera, off_nadir_deg=off_nadir))
        earth = globe_view(view, camera, earth_atmosphere("mono"))
        cut = tiles.earth_tiles(earth, camera, all_tiles(PixelRect(50, 50, 60, 60)), "2026-03-20")
        seen = np.zeros((150, 200), int)
        for kind, centers in cut.centers_px.items():
            size = round(cut.size_of(kind))
            for x, y in centers + 0.5 - size / 2:
                seen[round(y) : round(y) + size, round(x) : round(x) + size] += 1
        if full:
            assert np.all(seen == 1)
            assert {kind.covered for kind in cut.centers_px if kind.smooth} == {True, False}
        elif off_nadir == 180:
            assert not seen.any()
        else:
            assert seen.max() == 1
            assert 0 < seen.sum() < 200 * 150


def test_detail_tiles_and_its_histogram_is_even():
    detail = detail_texture()
    cloud = detail[..., 0].astype(float)
    for c in (0.2, 0.5, 0.8):
        assert (cloud / 255 > 1 - c).mean() == pytest.approx(c, abs=0.05)
    inner = np.abs(np.diff(cloud, axis=1)).mean()
    assert np.abs(cloud[:, 0] - cloud[:, -1]).mean() < 1.3 * inner


def test_cache_keeps_repairs_and_never_fails(tmp_path, monkeypatch, caplog):
    monkeypatch.setenv("FLYAROUND_CACHE_DIR", str(tmp_path / "deep" / "cache"))
    made = []

    def make():
        made.append(1)
        return np.arange(12, dtype=np.uint8).reshape(3, 4)

    for _ in range(2):
        assert np.array_equal(cache.cached_array("key", make), make())
    assert len(made) == 3  # ours twice, the cache's once
    (tmp_path / "deep" / "cache" / "key.npy").write_bytes(b"torn")
    assert np.array_equal(cache.cached_array("key", make), np.arange(12).reshape(3, 4))
    assert "made again" in caplog.text
    assert [p.name for p in (tmp_path / "deep" / "cache").iterdir()] == ["key.npy"]
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("FLYAROUND_CACHE_DIR", str(tmp_path / "file"))
    assert np.array_equal(cache.cached_array("key", make), np.arange(12).reshape(3, 4))
    assert "cannot keep" in caplog.text


def test_clear_air_is_as_thick_as_published():
    air = earth_atmosphere("rgb")
    depth = optical_depth_to_top(air, np.array(air.radius_m), np.array(1.0))
    # Rayleigh 0.0973 at 550 nm and 0.0498 at 650 nm (Bodhaine et al. 1999), ozone and aerosol on top
    rayleigh = air.rayleigh_m * air.rayleigh_height_m
    assert rayleigh[:2] == pytest.approx([0.0498, 0.0973], rel=0.2)
    assert depth - rayleigh == pytest.approx(
        air.mie_extinction_m * air.mie_height_m + air.ozone_m * 15_000, rel=0.015
    )
    slant = optical_depth_to_top(air, np.array(air.radius_m), np.array(0.5))
    assert slant / depth == pytest.approx(2.0, rel=0.01)


def test_light_is_neither_made_nor_lost_on_the_ground():
    air = earth_atmosphere("mono")
    mu = np.array([-0.05, 0.2, 0.6, 1.0])
    direct, diffuse = ground_irradiance(air, mu)
    assert direct[0, 0] == 0
    assert 0 < diffuse[0, 0] < 0.005  # dusk
    assert np.all(direct[1:, 0] + diffuse[1:, 0] < mu[1:])
    assert np.all(direct[1:, 0] + diffuse[1:, 0] > 0.6 * mu[1:])
