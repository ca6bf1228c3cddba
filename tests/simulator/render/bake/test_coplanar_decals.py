"""What lies flat on a larger face is told from what stands out of it, hangs over it, or floats above it."""

import numpy as np
import pytest

from simulator.render.bake.coplanar_decals import decal_heights
from tests.harness.boxes import closed_box

BODIES = {
    # name: corners [m], by how much it stands out of the panel's face z = 0 [m]
    "panel": ((-0.5, -0.4, -0.02), (0.5, 0.4, 0.0), np.inf),
    "cell": ((-0.1, -0.1, 0.0), (0.1, 0.1, 4e-4), 4e-4),
    "sunk foil": ((0.2, -0.3, -1e-4), (0.45, -0.1, 2e-4), 2e-4),
    "cell at the rim": ((0.3, 0.2, 0.0), (0.5, 0.39, 4e-4), 4e-4),
    "overhanging": ((-0.6, 0.2, 0.0), (-0.4, 0.3, 4e-4), np.inf),
    "floating": ((-0.3, 0.2, 0.05), (-0.2, 0.3, 0.0504), np.inf),
    "thick": ((-0.3, -0.3, 0.0), (-0.2, -0.2, 0.01), np.inf),
    "on the back": ((0.0, 0.2, -0.0205), (0.2, 0.3, -0.02), 5e-4),
    "under the panel's side": ((0.5, -0.1, -0.015), (0.5003, 0.1, -0.005), 3e-4),
}


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_relief_of_bodies_on_a_panel(turn):
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    parts = [closed_box(name, low, high) for name, (low, high, _) in BODIES.items()]
    positions = np.concatenate([p.positions_m.astype(float) @ R.T for p in parts])
    triangles = np.concatenate([np.asarray(p.triangles, int) + 24 * k for k, p in enumerate(parts)])
    heights = decal_heights(positions, triangles, 0.65).reshape(len(parts), -1)
    expected = np.array([[height] for _, _, height in BODIES.values()])
    np.testing.assert_allclose(heights, np.broadcast_to(expected, heights.shape), atol=2e-6)
