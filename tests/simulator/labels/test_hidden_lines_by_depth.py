"""The analytic hidden-line removal against the rendered depth: two routes to the same answer."""

import numpy as np
import pytest

from flyaround.simulator.labels.wireframe import view_edges
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.targets.joined_mesh import joined_mesh

pytestmark = pytest.mark.gl

N_POSES = 8
# One pixel of a surface at grazing view spans this much depth; nearer to a surface than this, depth cannot tell.
UNCLEAR_M = 0.03
SLACK_M = 0.001


def test_visible_stretches_agree_with_the_depth_map(renderer):
    plan = plan_recipe("eval-black", N_POSES, seed=40)
    told = wrong = 0
    for k in range(N_POSES):
        scene = plan.scene(k)
        depth = renderer.render(scene, plan.target, labels=True).depth_m
        filled = np.where(np.isnan(depth), 1e9, depth)
        for view in view_edges(scene.camera, scene.camera_from_target, plan.target, joined_mesh(plan.target)):
            if view.length_px < 8:
                continue
            shares = (np.arange(40) + 0.5) / 40
            pixels = view.at(shares)
            z = 1 / (view.inverse_depth[0] + shares * (view.inverse_depth[1] - view.inverse_depth[0]))
            for share, pixel, own in zip(shares, pixels, z, strict=True):
                if not scene.camera.contains(pixel):
                    continue
                u, v = np.rint(pixel).astype(int)
                patch = filled[max(v - 1, 0) : v + 2, max(u - 1, 0) : u + 2]
                margin = UNCLEAR_M + 1.5 * view.edge.radius_m
                visible_intervals = any(a <= share <= b for a, b in view.intervals)
                if patch.max() < own - margin:  # the whole neighbourhood is in front: hidden
                    told += 1
                    wrong += visible_intervals
                elif patch.min() > own - SLACK_M and view.edge.radius_m == 0 and not view.edge.normals:
                    told += 1
                    wrong += not visible_intervals
    assert told > 500
    # samples whose 3 x 3 pixels straddle a slot that the pixel grid does not resolve
    assert wrong / told < 0.005
