"""Images are cleared where something was drawn: a frame does not depend on previous ones."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

pytestmark = pytest.mark.gl


@pytest.mark.parametrize("bands", ["mono", "rgb"])
def test_frame_does_not_depend_on_previous_frames(bands):
    plans = {
        name: plan_flight(load_scenario(name), times=(30.0,))
        for name in ("tango-limb", "tango-space-10m", "lunar-orbit")
    }

    def scene(name, aside_m=0.0):
        plan = plans[name]
        still = replace(plan.scene(0), camera=plan.camera.resized(256), bands=bands)
        x, y, z = still.t_camera_from_target_m
        return replace(still, t_camera_from_target_m=(x + aside_m, y, z)), plan.target

    space = [scene("tango-space-10m", aside) for aside in (1.0, -1.0)]
    with Renderer() as fresh:
        expected = [fresh.render(*one).radiance for one in space]
    with Renderer() as renderer:
        for before in (scene("tango-limb"), scene("lunar-orbit", 2.0)):
            renderer.render(*before)
            for one, wanted in zip(space, expected, strict=True):
                assert np.array_equal(renderer.render(*one).radiance, wanted)
