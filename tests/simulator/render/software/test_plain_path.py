"""The GPU path without culling in Python draws the same images as the software path, up to interpolation."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

BLOCK = 16
VIEWS = [
    ("tango-earth-10m", "mono"),
    ("tango-earth-10m", "rgb"),
    ("tango-limb", "mono"),
    ("tango-night", "mono"),
    ("tango-close-3m", "mono"),
    ("tango-space-10m", "mono"),
]


@pytest.fixture(scope="module")
def renderers():
    with Renderer(software_path=True) as spared, Renderer(software_path=False) as plain:
        yield spared, plain


def quarter(camera):
    return camera.resized(camera.width_px // 4)


def _blocks(image):
    """Means over squares of ``BLOCK`` pixels."""
    height, width = (side // BLOCK for side in image.shape[:2])
    cut = image[: height * BLOCK, : width * BLOCK]
    return cut.reshape(height, BLOCK, width, BLOCK, -1).mean(axis=(1, 3))


@pytest.mark.gl
@pytest.mark.parametrize(("name", "bands"), VIEWS)
def test_culling_hardly_changes_the_image(renderers, name, bands):
    plan = plan_flight(load_scenario(name), n=1)
    scene = replace(plan.scene(0), camera=quarter(plan.camera), bands=bands)
    spared, plain = (one.render(scene, plan.target, labels=True) for one in renderers)
    # the same samples, however they are found; shares of slivers are told in steps of 0.00025
    np.testing.assert_allclose(spared.coverage, plain.coverage, atol=3e-4)
    craft = spared.coverage > 0.99
    off = np.abs(spared.radiance - plain.radiance)[craft]
    of_craft = spared.radiance[craft]
    # tiles without edges are interpolated: within 2 % of the craft's brightest, by a thousandth in the mean
    assert off.max() < 0.02 * of_craft.max()
    assert off.mean() < 1e-3 * of_craft.mean()
    # ground of one level of detail a tile, which may be half a level sharper: the same brightness, other cloud edges
    assert plain.radiance.mean() == pytest.approx(spared.radiance.mean(), rel=0.015)
    blocks = _blocks(spared.radiance)
    assert np.abs(blocks - _blocks(plain.radiance)).max() < 0.06 * blocks.max()


@pytest.mark.gl
@pytest.mark.parametrize("camera", ["speedplus", "fisheye-140"])
def test_nothing_that_a_lens_shows_of_a_craft_is_left_out(renderers, camera):
    plan = plan_flight(load_scenario("tango-close-3m"), n=1)
    scene = replace(plan.scene(0), camera=quarter(load_camera(camera)))
    spared, plain = (one.render(scene, plan.target, labels=True) for one in renderers)
    np.testing.assert_allclose(spared.coverage, plain.coverage, atol=1e-3)
    craft = spared.coverage > 0.99
    off, of_craft = np.abs(spared.radiance - plain.radiance)[craft], spared.radiance[craft]
    assert off.max() < 0.05 * of_craft.max()
    assert off.mean() < 1e-3 * of_craft.mean()


@pytest.mark.gl
def test_untextured_image_is_reproducible(renderers):
    plan = plan_flight(load_scenario("tango-earth-10m"), n=2)
    first, other = (replace(plan.scene(k), camera=quarter(plan.camera)) for k in (0, 1))
    once = renderers[1].render(first, plan.target).radiance
    renderers[1].render(other, plan.target)
    assert renderers[1].render(first, plan.target).radiance.tobytes() == once.tobytes()
