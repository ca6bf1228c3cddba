"""The shadow map covers the visible surface: sharp on a long target at close range, complete in view."""

import numpy as np
import pytest

from flyaround.simulator.baking.baked_mesh import VERTEX
from flyaround.simulator.render.craft.mesh import upload
from flyaround.simulator.render.craft.shadow_frustum import SurfacePatches, fit_shadow_frustum, light_matrix
from flyaround.simulator.render.craft.visible_triangles import visible_triangles
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.targets.model import Material
from flyaround.simulator.world.frames.rotation import matrix_from_quat

pytestmark = pytest.mark.gl

BLACK = Material(name="black", base_color=(0.0, 0.0, 0.0), roughness=1.0)


def test_a_shadow_on_a_long_craft_is_where_geometry_says(renderer, draw_kit):
    # a square 0.3 m in front of a wall, and the ends of wings 15 m away: texels of the whole box would be 42 mm
    parts = [
        draw_kit.plate("wall", "white", (0, 0, 0), 0.8),
        draw_kit.plate("blind", "black", (-0.2, 0, -0.3), 0.1),
        *(draw_kit.plate(f"wing {x}", "white", (x, x, 0), 0.4) for x in (-15, 15)),
    ]
    target = draw_kit.target(parts, [draw_kit.white(), BLACK])
    scene = draw_kit.scene(target, sun_camera=(-1, 0, -1))
    image = renderer.render(scene, target).radiance.astype(float)
    for edge_x, step in ((0.0, -1), (0.2, 1)):
        u, v = scene.camera.project([edge_x, 0.0, 5.0])
        x0 = round(u) - 8
        profile = np.clip(image[round(v), x0 : x0 + 17] / image[118, 230], 0, 1)
        dark = (1 - profile).sum()
        edge = x0 + 16.5 - dark if step < 0 else x0 - 0.5 + dark
        assert abs(edge - u) < 0.7  # 6 mm
        # 10 and 90 % of the light are a few texels of 2 mm apart
        assert ((profile > 0.1) & (profile < 0.9)).sum() <= 3


@pytest.mark.parametrize("name", ["tianzhou", "tango"])
def test_shadow_window_contains_all_visible_surface(renderer, draw_kit, name):
    mesh = upload(renderer.device.context, load_target(name))
    positions = np.frombuffer(mesh.vertices.read(), VERTEX)["position_m"].astype(float)
    patches = SurfacePatches.from_mesh(mesh, positions)
    rng, camera, smaller = np.random.default_rng(7), draw_kit.camera, 0
    for _ in range(40):
        q = rng.standard_normal(4)
        camera_from_target = np.eye(4)
        camera_from_target[:3, :3] = matrix_from_quat(q / np.linalg.norm(q))
        camera_from_target[:3, 3] = rng.normal(0, 0.3, 3) * mesh.radius_m
        camera_from_target[2, 3] += rng.uniform(0.4, 1.5) * mesh.radius_m
        along = rng.standard_normal(3)
        light = light_matrix(mesh.center_m, mesh.radius_m, along / np.linalg.norm(along))
        window = fit_shadow_frustum(patches, camera, camera_from_target, light, closed=mesh.is_closed)
        smaller += window.half < 1
        place = -camera_from_target[:3, :3].T @ camera_from_target[:3, 3]
        shown = visible_triangles(mesh, np.append(place, 1.0)) if mesh.is_closed else mesh.triangles
        # points all over the triangles that face the camera, and in the image
        weights = rng.dirichlet(np.ones(3), len(shown))
        points = np.einsum("ij,ijk->ik", weights, positions[shown])
        seen = points @ camera_from_target[:3, :3].T + camera_from_target[:3, 3]
        points, seen = points[seen[:, 2] > 0.01], seen[seen[:, 2] > 0.01]
        pixels = seen[:, :2] / seen[:, 2:] * [camera.fx_px, camera.fy_px] + [camera.cx_px, camera.cy_px]
        inside = np.all((pixels > -0.5) & (pixels < [camera.width_px - 0.5, camera.height_px - 0.5]), axis=1)
        clip = points[inside] @ light[:2, :3].T + light[:2, 3]
        if len(clip):
            assert np.abs(clip - [window.x, window.y]).max() <= window.half * (1 - 1 / 64)
    assert smaller > 10
    mesh.release()
