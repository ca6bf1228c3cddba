"""Fresnel reflectance in the shaders: surfaces, clear coats, sea."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flyaround.simulator.render.gl.programs import read_source
from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.targets.model import Material

pytestmark = pytest.mark.gl
COSINES = np.linspace(0.05, 1.0, 64)
SCREEN = """#version 410 core
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }"""


def fresnel(index, cosine):
    """Unpolarised reflectance of a dielectric in air: Born & Wolf (1999), section 1.5.2."""
    within = np.sqrt(1 - (1 - cosine**2) / index**2)
    s = (cosine - index * within) / (cosine + index * within)
    p = (index * cosine - within) / (index * cosine + within)
    return (s**2 + p**2) / 2


def evaluated(renderer, functions, expression):
    """A GLSL expression of the cosine ``c`` at each of `COSINES`."""
    context = renderer.device.context
    step, low = COSINES[1] - COSINES[0], COSINES[0]
    program = context.program(
        vertex_shader=SCREEN,
        fragment_shader=f"#version 410 core\n{functions}\nout vec4 o;\nvoid main() {{ "
        f"float c = {low} + (gl_FragCoord.x - 0.5) * {step}; o = vec4({expression}); }}",
    )
    picture = context.texture((len(COSINES), 1), 1, dtype="f4")
    frame = context.framebuffer([picture])
    frame.use()
    context.disable(context.DEPTH_TEST | context.BLEND | context.CULL_FACE)
    context.vertex_array(program, []).render(mode=context.TRIANGLES, vertices=3)
    return np.frombuffer(picture.read(), np.float32).astype(float)


def test_schlick_s_reflectance_of_glass_and_of_water(renderer):
    text = read_source("craft/brdf.glsl")
    functions = "#define BANDS 1\n" + re.sub(r"#version.*", "", text)
    glass = evaluated(renderer, functions, "fresnel_schlick(0.04, c)")
    coat = evaluated(renderer, functions, "0.04 + 0.96 * pow5(1.0 - c)")
    sea = re.search(r"float water_fresnel\(float c\) \{[^}]*\}", read_source("earth/earth.frag")).group()
    water = evaluated(renderer, sea, "water_fresnel(c)")
    assert glass == pytest.approx(coat, rel=1e-5)
    # Schlick (1994) is within 0.06 of Fresnel over these angles; a fourth power is off by up to 0.1
    for schlick, index in ((glass, 1.5), (water, 1.34)):
        exact = fresnel(index, COSINES)
        assert np.abs(schlick - exact).max() < 0.065
        assert np.abs(schlick - exact).mean() < 0.02
    # and by the paper's own formula
    assert glass == pytest.approx(0.04 + 0.96 * (1 - COSINES) ** 5, abs=1e-5)
    assert water == pytest.approx(0.0211 + 0.9789 * (1 - COSINES) ** 5, abs=1e-5)


def glossy_lobe(roughness, n, v, s):
    """GGX distribution, height-correlated masking and projection, without Fresnel [sr-1]."""
    h = (v + s) / np.linalg.norm(v + s)
    n_l, n_v, n_h = n @ s, n @ v, n @ h
    alpha2 = roughness**4
    d = alpha2 / (np.pi * (n_h**2 * (alpha2 - 1) + 1) ** 2)

    def smith(c):
        return (-1 + np.sqrt(1 + alpha2 * (1 - c * c) / c**2)) / 2

    return d / (1 + smith(n_l) + smith(n_v)) / (4 * n_v)


@pytest.mark.parametrize("slant_deg", [20.0, 55.0, 65.0, 72.0])
@pytest.mark.parametrize("coat", [False, True])
def test_glossy_black_plate_reflects_more_at_grazing_angles(renderer, draw_kit, slant_deg, coat):
    black = Material(name="black", base_color=(0.0, 0.0, 0.0), roughness=1.0 if coat else 0.5)
    if coat:
        black = Material(
            name="black", base_color=(0.0, 0.0, 0.0), roughness=1.0, clearcoat=1.0, clearcoat_roughness=0.5
        )
    target = draw_kit.target([draw_kit.plate("p", "black", (0, 0, 0), 0.6)], [black])
    a = np.radians(slant_deg)
    # the camera looks along z, the plate is turned about y, the Sun is where a mirror would show it
    n = Rotation.from_rotvec([0, a, 0]).apply([0, 0, -1.0])
    scene = draw_kit.scene(target, rotvec_rad=(0, a, 0), sun_camera=-2 * n[2] * n - [0, 0, -1.0])
    image = renderer.render(scene, target).radiance
    x, y = 161, 119
    v = -np.array([(x - 161.3) / 600, (y - 118.6) / 590, 1.0])
    v /= np.linalg.norm(v)
    s = np.array(scene.sun_direction_camera)
    irradiance = sun_irradiance_w_m2("mono", np.linalg.norm(scene.r_sun_eci_m))[0]
    lobe = glossy_lobe(0.5, n, v, s)
    assert n @ s == pytest.approx(np.cos(a), abs=0.01)
    # light between microfacets and, under the coat, the rough base's own gloss are a few hundredths of it
    schlick = 0.04 + 0.96 * (1 - np.cos(a)) ** 5
    assert image[y, x] / (irradiance * lobe) == pytest.approx(schlick, rel=0.08)
