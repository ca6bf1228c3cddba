"""The chaser's lamp and brushed metal in pictures."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.labels.keypoints import geometric_states
from flyaround.simulator.scene.illumination.irradiance import uniform_field
from flyaround.simulator.scene.illumination.lamp import Lamp
from flyaround.simulator.targets.joined_mesh import joined_mesh
from flyaround.simulator.targets.library import load_target
from tools.validation.rendering import brushed as rendering_brushed
from tools.validation.rendering import lamp as rendering_lamp

pytestmark = pytest.mark.gl


def test_lamp_lights_a_plate_by_its_beam(renderer):
    (row,) = rendering_lamp.rows(renderer)
    assert row.met, row


def test_power_is_all_in_the_beam():
    for profile in ("led", "gaussian", "flat"):
        lamp = Lamp(power_w=3.0, half_angle_deg=15.0, profile=profile)
        angle = np.linspace(0, np.pi / 2, 20_001)
        middle = (angle[1:] + angle[:-1]) / 2
        ring = 2 * np.pi * np.sin(middle) * np.diff(angle)
        assert (lamp.beam(middle) * ring).sum() * lamp.intensity_w_sr("mono")[0] == pytest.approx(
            3.0, rel=1e-3
        )
        if profile != "flat":
            assert lamp.beam(np.radians(15.0)) == pytest.approx(0.5)
        assert lamp.intensity_w_sr("rgb").shape == (3,)


def test_brushed_metal_reflects_its_lobe(renderer):
    row = rendering_brushed.sphere_row(renderer)
    assert row.met, row


def test_grain_turns_with_the_craft_and_the_sky_is_kept(renderer, draw_kit):
    # a highlight is long across the grain: of two plates side by side under a low Sun, one glows
    brushed = draw_kit.white(
        base_color=(0.9,) * 3, metallic=1.0, roughness=0.3, anisotropy=0.8, grain=(1.0, 0, 0)
    )

    def radiance(turn_rad, grain):
        target = draw_kit.target(
            [draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [replace(brushed, grain=grain)]
        )
        scene = draw_kit.scene(target, rotvec_rad=(0, 0, turn_rad), sun_camera=(0.9, 0, -1.0))
        return float(renderer.render(scene, target).radiance[118, 161])

    along, across = radiance(0.0, (1.0, 0, 0)), radiance(0.0, (0, 1.0, 0))
    assert across > 5 * along
    assert radiance(np.pi / 2, (1.0, 0, 0)) == pytest.approx(across, rel=0.02)
    # around x on a plate that contains it is across x
    lathe = draw_kit.target(
        [draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [replace(brushed, grain=(1.0, 0, 0), turned=True)]
    )
    scene = draw_kit.scene(lathe, sun_camera=(0.9, 0, -1.0))
    assert float(renderer.render(scene, lathe).radiance[118, 161]) == pytest.approx(across, rel=0.01)
    white = replace(brushed, base_color=(1.0,) * 3)
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [white])
    scene = replace(draw_kit.scene(target, rotvec_rad=(0, 0.5, 0)), sun_visible_fraction=0.0)
    seen = renderer.render(scene, target, sky=uniform_field(np.array([7.0]))).radiance[118, 161]
    assert seen == pytest.approx(7.0, rel=0.01)


def test_keypoints_that_the_lamp_lights_are_not_eclipsed(draw_kit):
    tango = load_target("tango")
    scene = replace(draw_kit.scene(tango, t_m=(0, 0, 8.0)), sun_visible_fraction=0.0)
    dark = geometric_states(scene, tango, joined_mesh(tango))
    lit = geometric_states(replace(scene, lamp=Lamp(power_w=20.0)), tango, joined_mesh(tango))
    assert "eclipsed" in dark
    assert [None if state == "eclipsed" else state for state in dark] == list(lit)
