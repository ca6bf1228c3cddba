"""A scene some time from mid-exposure: both craft fall as they do."""

import numpy as np
import pytest

from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.scene.motion import propagated_scene
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import propagate


@pytest.mark.parametrize("dt_s", [-2.0, 0.5, 2.0])
def test_both_craft_fall_freely(dt_s):
    """To second order in two seconds: the third is 1.3e-6 of the radius cubed in n dt, 12 mm; half the fall is 17 m."""
    scene = plan_recipe("eval-earth", 3, seed=5).scene(2)
    then = propagated_scene(scene, dt_s)
    for r, v, r_then, v_then in (
        (scene.r_target_eci_m, scene.v_target_eci_m_s, then.r_target_eci_m, then.v_target_eci_m_s),
        (scene.r_camera_eci_m, scene.v_camera_eci_m_s, then.r_camera_eci_m, then.v_camera_eci_m_s),
    ):
        sign = np.sign(dt_s)
        there, fast = propagate(np.array(r), sign * np.array(v), abs(dt_s), Gravity(j2=0.0))(abs(dt_s))
        assert r_then == pytest.approx(there, abs=0.02)
        assert v_then == pytest.approx(sign * fast, abs=0.03)
