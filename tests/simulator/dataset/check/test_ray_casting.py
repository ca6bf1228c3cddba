"""The check's rays: which pixels are sampled, and what of a triangle that reaches behind the camera is met."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from flyaround.simulator.dataset.check.ray_casting import RayOracle, sample_pixels
from flyaround.simulator.targets.joined_mesh import joined_mesh
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.pose import Pose


@pytest.mark.parametrize("rolling", [False, True])
def test_every_part_is_asked_about_once_though_it_be_a_pixel(*, rolling):
    mask = np.zeros((400, 400), np.uint8)
    mask[50:350, 50:350] = 255
    parts = np.where(mask > 0, 1, 0).astype(np.uint16)
    single = {2: (60, 70), 3: (349, 349), 7: (200, 51)}
    for part, (y, x) in single.items():
        parts[y, x] = part
    should = np.array([[5, 6]])
    sampler = SimpleNamespace(part_pixels=lambda: should)
    truth = SimpleNamespace(seed=4, frame_index=9, row_poses=(1,) if rolling else ())
    asked = {tuple(p) for p in sample_pixels(truth, mask, {"parts": parts}, sampler).tolist()}
    assert len(asked) > 10
    found = {part for part, (y, x) in single.items() if (x, y) in asked}
    # of a rolling shutter no pixel's part is known by geometry alone
    assert found == (set() if rolling else set(single))
    assert ((5, 6) in asked) is not rolling
    assert sample_pixels(truth, 0 * mask, {}, sampler).shape == (0, 2)


def test_rays_meet_what_is_ahead_of_a_triangle_that_reaches_behind_the_camera():
    target = load_target("cubesat-1u")
    q = [0.24645180188688268, -0.7264408647937025, -0.0040488810846959185, -0.6415050941858904]
    pose = Pose.from_arrays("camera", "target", q, [-0.006135, -0.019346, 0.216728])
    mesh = joined_mesh(target)
    corners = pose.apply(mesh.positions_m)[mesh.triangles]
    assert ((corners[..., 2].min(axis=1) < 0) & (corners[..., 2].max(axis=1) > 0.05)).any()
    # an independent caster, double precision
    intersector = trimesh.ray.ray_triangle.RayMeshIntersector(
        trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=False)
    )
    caster = RayOracle(target, pose)
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
