"""A renderer that alternates between cameras with and without distortion draws the same images."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.camera.lens.distortion import Distortion
from flyaround.simulator.render.renderer import Renderer

pytestmark = pytest.mark.gl
NEAR_M, FAR_M = (
    5.0,
    400.0,
)  # many tiles without edges; a lens that bends no edge visibly, so that nothing is cut


@pytest.fixture(scope="module")
def drawn(draw_kit):
    """What a renderer shows of a plate, by whether the camera has a lens, one after the other."""
    pinhole = replace(
        draw_kit.camera, width_px=800, height_px=760, fx_px=2600.0, fy_px=2600.0, cx_px=399.3, cy_px=380.4
    )
    lens = replace(pinhole, distortion=Distortion("brown_conrady", (-0.22, 0.5, -0.0007, 0.0)))
    target = draw_kit.target([draw_kit.plate("p", "white", (0.05, 0.1, 0), 0.45)], [draw_kit.white()])

    def draw(order, z_m):
        seen = {}
        with Renderer(software_path=True) as renderer:
            for has_lens in order:
                scene = draw_kit.scene(
                    target,
                    t_m=(0.1 * z_m / 5, 0.08 * z_m / 5, z_m),
                    camera=lens if has_lens else pinhole,
                    rotvec_rad=(0.1, -0.2, 0.3),
                )
                image = renderer.render(scene, target, labels=True)
                surfaces = renderer.surfaces(scene, target, layers=True)
                seen[has_lens] = (
                    image.radiance,
                    image.coverage,
                    image.depth_m,
                    surfaces.normals,
                    surfaces.parts,
                )
        return seen

    return draw


@pytest.mark.parametrize("z_m", [NEAR_M, FAR_M])
@pytest.mark.parametrize("lens_first", [True, False])
def test_image_does_not_depend_on_the_previous_camera(drawn, z_m, lens_first):
    second = not lens_first
    mixed, alone = drawn([lens_first, second], z_m)[second], drawn([second], z_m)[second]
    assert np.isfinite(alone[2]).any()
    for one, other in zip(mixed, alone, strict=True):
        np.testing.assert_array_equal(one, other)
