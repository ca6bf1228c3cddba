"""Resolution of the default shadow map: no staircase on the edges of shadows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from flyaround.simulator.targets.model import Material

pytestmark = pytest.mark.gl

BLACK = Material(name="black", base_color=(0.0, 0.0, 0.0), roughness=1.0)


def ring(draw_kit, middle_m, inner_m, outer_m, n=96):
    """A flat ring of quads that looks at the camera."""
    angles = np.linspace(0, 2 * np.pi, n + 1)
    place = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    for k in range(n):
        rim = ((inner_m, k), (inner_m, k + 1), (outer_m, k + 1), (outer_m, k))
        yield draw_kit.quad(f"ring {k}", "black", [np.add(middle_m, r * place[j]) for r, j in rim])


def test_the_edge_of_a_rings_shadow_is_round(renderer, draw_kit):
    # a ring 0.3 m above a wall throws a round shadow on it. What stands 3 m behind the wall makes the
    # craft's sphere four times as large, but the Sun sees it as small as before.
    parts = [
        draw_kit.plate("wall", "white", (0, 0, 0), 0.45),
        *ring(draw_kit, (-0.3, 0, -0.3), 0.12, 0.19),
        draw_kit.plate("end", "black", (2, 0, 2), 0.02),
    ]
    target = draw_kit.target(parts, [draw_kit.white(), BLACK])
    camera = replace(draw_kit.camera, width_px=640, cx_px=320.7)
    scene = draw_kit.scene(target, camera=camera, t_m=(0, 0, 2.6), sun_camera=(-1, 0, -1))
    image = renderer.render(scene, target).radiance.astype(float)
    u, v = scene.camera.project([0.0, 0.0, 2.6])
    white = image[round(v), round(u)]  # inside of the ring's shadow
    # how far the light reaches along each degree's ray from the middle of the shadow; the ring itself is before some
    angles = np.radians(np.arange(-100, 101))[:, None]
    far = np.arange(16, 40, 0.1)
    pixel = scene.camera.fx_px / 2.6, scene.camera.fy_px / 2.6
    inner_px, outer_px = 0.12 * pixel[0], 0.19 * pixel[0]
    places = np.array([v + far * np.sin(angles) * pixel[1] / pixel[0], u + far * np.cos(angles)])
    light = map_coordinates(image / white, places, order=1)
    middle = len(far) * (0.5 * (inner_px + outer_px) - far[0]) / (far[-1] + 0.1 - far[0])
    found = far[0] + 0.1 * light[:, : round(middle)].sum(axis=1)
    assert np.std(found) < 0.1
    assert np.abs(found - inner_px).max() < 0.3
