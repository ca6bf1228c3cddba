"""Parts of the renderer on their own: sample pattern, uniform layout, shader text, tiles, noise, cache."""

from types import MappingProxyType

import cv2
import numpy as np
import pytest

from flyaround.simulator.celestial.detail_noise import cumulus_texture, detail_texture
from flyaround.simulator.render.craft.viewport_fit import PATTERNS as PRESETS
from flyaround.simulator.render.craft.viewport_fit import TINY_PATTERN
from flyaround.simulator.render.gl.shared_blocks import FRAME, GLOBE, MATERIALS, TARGET
from flyaround.simulator.render.gl.uniform_block import Field, UniformBlock
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


@pytest.mark.gl
def test_uniform_block_layout_matches_the_driver(renderer):
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
def test_values_that_a_block_refused_are_refused_again(renderer):
    block = UniformBlock(renderer.device.context, "Probe", 7, (Field("float", "a"),))
    values = MappingProxyType({"b": 1.0})
    for _ in range(2):
        with pytest.raises(KeyError):
            block.write(values)


@pytest.mark.parametrize("texture", [detail_texture, cumulus_texture])
def test_detail_tiles_and_its_histogram_is_even(texture):
    cloud = texture()[..., 0].astype(float)
    for c in (0.2, 0.5, 0.8):
        assert (cloud / 255 > 1 - c).mean() == pytest.approx(c, abs=0.05)
    inner = np.abs(np.diff(cloud, axis=1)).mean()
    assert np.abs(cloud[:, 0] - cloud[:, -1]).mean() < 1.3 * inner


def test_borders_of_clouds_are_as_ragged_as_measured():
    cloudy = (cumulus_texture()[..., 0] > 0.7 * 255).astype(np.uint8)  # a share of 0.3
    count, label, stats, _ = cv2.connectedComponentsWithStats(cloudy, connectivity=4)
    perimeter = np.zeros(count)
    for axis in (0, 1):
        beside = np.roll(label, -1, axis)
        for one in (label, beside):
            np.add.at(perimeter, one[label != beside], 1)
    area = stats[:, cv2.CC_STAT_AREA].astype(float)
    sized = (area > 30) & (area < 20_000)  # 1.6 to 1,000 km2
    slope = np.polyfit(np.log(area[sized]), np.log(perimeter[sized]), 1)[0]
    # P ~ A^(D/2), D = 1.35 +- 0.05 from 1 to 1e6 km2 (Lovejoy 1982, Science 216, 185)
    assert 2 * slope == pytest.approx(1.35, abs=0.05)


def test_clear_air_is_as_thick_as_published():
    air = earth_atmosphere("rgb")
    depth = optical_depth_to_top(air, np.array(air.radius_m), np.array(1.0))
    # Rayleigh 0.0502 and 0.0999 (Bodhaine et al. 1999), the aerosol 0.041 and 0.050, 300 Dobson units of ozone
    assert depth[:2] == pytest.approx([0.0502 + 0.0415 + 0.0215, 0.0999 + 0.0502 + 0.0263], rel=0.03)
    slant = optical_depth_to_top(air, np.array(air.radius_m), np.array(0.5))
    assert slant / depth == pytest.approx(2.0, rel=0.01)


def test_ground_irradiance_is_less_than_the_suns():
    air = earth_atmosphere("mono")
    mu = np.array([-0.05, 0.2, 0.6, 1.0])
    direct, diffuse = ground_irradiance(air, mu)
    assert direct[0, 0] == 0
    assert 0 < diffuse[0, 0] < 0.005  # dusk
    assert np.all(direct[1:, 0] + diffuse[1:, 0] < mu[1:])
    assert np.all(direct[1:, 0] + diffuse[1:, 0] > 0.6 * mu[1:])
