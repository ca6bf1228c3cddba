"""Uniforms that a vertex shader hands on: found in the text, and the picture is the same to the last bit."""

import numpy as np
import pytest

from flyaround.simulator.render.gl.uniform_block import Field
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.render.software.flat_varyings import flat_varyings
from tests.harness.boxes import closed_box

pytestmark = pytest.mark.gl

FIELDS = (
    Field("vec4", "u_sun"),
    Field("mat4", "u_turn"),
    Field("vec4", "u_sky", 3),
    Field("vec4", "u_table", 9),
)
VERTEX = "uniform vec4 u_window;\nvoid main() { gl_Position = u_turn * u_window; }\n"
FRAGMENT = """uniform vec2 u_texel, u_size; // one line, two names
uniform vec4 u_window;
uniform sampler2D t_map;
void main() { light = u_sun * u_sky[2] + u_sky[0] + u_table[k] + texture(t_map, u_texel * u_size) + u_window; }
"""


def test_what_every_fragment_reads_the_same_is_handed_on():
    vertex, fragment = flat_varyings(VERTEX, FRAGMENT, FIELDS, slots=16)
    assert (
        "v_u_sun * v_u_sky_2 + v_u_sky_0 + u_table[k] + texture(t_map, v_u_texel * v_u_size) + v_u_window"
        in fragment
    )
    assert "uniform sampler2D t_map;" in fragment
    assert "u_turn" not in fragment  # it does not use it
    assert vertex.count("uniform vec4 u_window;") == 1
    for name in ("u_sun", "u_sky[2]", "u_sky[0]", "u_texel", "u_size", "u_window"):
        assert f"v_{name.replace('[', '_').rstrip(']')} = {name};" in vertex


def test_a_name_within_a_longer_one_is_left_alone():
    fragment = "uniform vec4 u_sun_w;\nvoid main() { light = u_sun * my_u_sun + u_sunset + u_sun_w; }\n"
    _, made = flat_varyings(VERTEX, fragment, FIELDS, slots=16)
    assert "light = v_u_sun * my_u_sun + u_sunset + v_u_sun_w;" in made


def test_what_finds_no_slot_stays_a_uniform():
    vertex, fragment = flat_varyings(VERTEX, FRAGMENT, FIELDS, slots=2)
    assert "v_u_sun * u_sky[2] + v_u_sky_0 +" in fragment
    assert "uniform vec2 u_texel; uniform vec2 u_size;" in fragment
    assert vertex.count("flat out") == 2


@pytest.mark.parametrize("bands", ["mono", "rgb"])
def test_pictures_are_the_same_with_uniforms(renderer, draw_kit, monkeypatch, bands):
    box = closed_box("box", (-0.7, -0.6, -0.5), (0.6, 0.5, 0.4), "gloss")
    foil = draw_kit.plate("foil", "foil", (0.3, 0.1, -0.9), 0.5)
    materials = [
        draw_kit.white(name="gloss", clearcoat=1.0, clearcoat_roughness=0.05),
        draw_kit.white(name="foil", crinkle=0.3, metallic=1.0, roughness=0.3),
    ]
    target = draw_kit.target([box, foil], materials)
    scene = draw_kit.scene(target, rotvec_rad=(0.3, 0.5, 0.1), sun_camera=(0.5, 0.4, -1), bands=bands)
    handed = renderer.render(scene, target).radiance.copy()
    with Renderer() as other:
        monkeypatch.setattr(other._device.programs, "rewrite", None)
        plain = other.render(scene, target).radiance.copy()
    assert handed.max() > 0
    assert np.array_equal(handed, plain)
