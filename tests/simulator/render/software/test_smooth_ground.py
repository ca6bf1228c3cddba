"""Ground interpolated over tiles against ground per pixel: low and high orbits, poles, the Moon."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.imaging.image_formation import expose_scene
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight


def _scene(name, width_px, **changes):
    scenario = load_scenario(name)
    plan = plan_flight(scenario, times=(scenario.duration_s / 2,))
    return replace(plan.scene(0), camera=plan.camera.resized(width_px), **changes), plan.target


# largest rms of the difference [digital numbers]: level of detail by tile, and clouds' edges off by parts of a pixel
@pytest.mark.gl
@pytest.mark.parametrize(
    ("name", "most_dn"), [("geo-inspection", 1.0), ("tango-flyaround", 1.5), ("lunar-orbit", 1.0)]
)
def test_interpolated_tiles_match_per_pixel_ground(name, most_dn):
    scene, target = _scene(name, 960)
    signals = []
    for path in (True, False):
        with Renderer(software_path=path) as renderer:
            signals.append(expose_scene(scene, renderer.render(scene, target).radiance).clip(0, 1) * 255)
    off = signals[0] - signals[1]
    assert signals[1].mean() > 2
    assert 0 < np.sqrt(np.mean(off**2)) < most_dn
    assert abs(off.mean()) < 0.1
