"""Rays from a camera that a part of the mesh reaches behind: what of a triangle is ahead is met."""

import numpy as np
import trimesh

from flyaround.simulator.dataset.check.ray_casting import RayCaster
from flyaround.simulator.targets.joined_mesh import mesh_of
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.pose import Pose


def test_rays_meet_what_is_ahead_of_a_triangle_that_reaches_behind_the_camera():
    target = load_target("cubesat-1u")
    q = [0.24645180188688268, -0.7264408647937025, -0.0040488810846959185, -0.6415050941858904]
    pose = Pose.of("camera", "target", q, [-0.006135, -0.019346, 0.216728])
    mesh = mesh_of(target)
    corners = pose.apply(mesh.positions_m)[mesh.triangles]
    assert ((corners[..., 2].min(axis=1) < 0) & (corners[..., 2].max(axis=1) > 0.05)).any()
    # an independent caster, double precision
    intersector = trimesh.ray.ray_triangle.RayMeshIntersector(
        trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=False)
    )
    caster = RayCaster(target, pose)
    rng = np.random.default_rng(0)
    rays = np.concatenate([rng.uniform(-0.5, 0.5, (60, 2)), np.array([[-0.23, -0.48], [-0.22, -0.47]])])
    rays = np.insert(rays, 2, 1.0, axis=1)
    met = 0
    for ray in rays:
        places, _, _ = intersector.intersects_location([[0.0, 0.0, 0.0]], [ray], multiple_hits=True)
        ahead = places[places[:, 2] > 1e-3] if len(places) else places
        found = caster.hits(ray)
        assert (len(ahead) == 0) == (len(found.z_m) == 0)
        if len(ahead):
            met += 1
            assert abs(found.z_m[0] - ahead[:, 2].min()) < 1e-9
    assert met > 10
