"""Ground that is drawn once and smeared, with the craft before it, against the mean of many whole pictures."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.imaging.exposure import ground_drawings, integrate
from flyaround.simulator.imaging.image_formation import expose_scene
from flyaround.simulator.imaging.image_motion import image_motion_px
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.scene.motion import propagated_scene

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def plan():
    plan = plan_flight(load_scenario("tango-earth-10m-1024"), times=(30.0,))
    # four times the angle per pixel
    return replace(plan, camera=plan.camera.resized(256))


def _exposed(plan, exposure_s, **changes):
    scene = replace(plan.scene(0), **changes)
    # as bright on the detector as before
    scale = exposure_s / scene.exposure_s
    sensor = replace(scene.sensor, full_scale_j_m2_sr=scene.sensor.full_scale_j_m2_sr * scale)
    return replace(scene, exposure_s=exposure_s, sensor=sensor)


@pytest.mark.parametrize("bands", ["mono", "rgb"])
def test_craft_and_ground_drawn_apart_add_up_to_the_picture(renderer, plan, bands):
    scene = replace(plan.scene(0), bands=bands)
    whole = renderer.render(scene, plan.target).radiance
    ground = renderer.render(scene, plan.target, layer="sky").radiance
    craft = renderer.render(scene, plan.target, layer="craft")
    joined = ground.copy()
    open_ = 1 - craft.coverage
    joined[craft.window] *= open_ if bands == "mono" else open_[..., None]
    joined[craft.window] += craft.radiance
    assert craft.coverage.max() == pytest.approx(1, abs=1e-5)
    assert np.abs(joined - whole).max() < 1e-5 * whole.max()


@pytest.mark.parametrize(
    ("exposure_s", "spin_rad_s", "bands", "lens"),
    [
        (0.3, 0.5, "mono", ""),
        (0.6, 0.0, "mono", ""),
        (0.4, 0.1, "rgb", ""),
        (0.4, 0.1, "mono", "speedplus"),
    ],
)
def test_the_smear_is_the_mean_of_four_times_the_instants(
    renderer, plan, exposure_s, spin_rad_s, bands, lens
):
    scene = _exposed(plan, exposure_s, bands=bands, omega_target_rad_s=(0.0, spin_rad_s, 0.0))
    if lens:
        bent = replace(scene.camera, distortion=load_camera(lens).distortion)
        scene = replace(scene, camera=bent)
    assert ground_drawings(scene) > 0
    motion = image_motion_px(scene, plan.target, exposure_s)
    n = 4 * max(3, int(np.ceil(motion)))
    times = exposure_s * ((np.arange(n) + 0.5) / n - 0.5)
    expected = sum(
        renderer.render(propagated_scene(scene, float(dt)), plan.target).radiance.astype(float)
        for dt in times
    )
    got = integrate(renderer, scene, plan.target)
    assert got.n_drawn < n / 2
    signal, wanted = (expose_scene(scene, np.asarray(r, np.float32)) for r in (got.radiance, expected / n))
    still = expose_scene(scene, renderer.render(scene, plan.target).radiance)
    rms, unsmeared = (np.sqrt(np.mean((s - wanted) ** 2) / np.mean(wanted**2)) for s in (signal, still))
    assert rms < 0.006
    assert rms < 0.5 * unsmeared
    assert signal.mean() == pytest.approx(wanted.mean(), rel=1e-3)


def test_sky_in_view_is_drawn_instant_by_instant(plan):
    scene = _exposed(plan, 0.1)
    assert ground_drawings(scene) > 0
    assert (
        ground_drawings(replace(scene, environment=msgspec.structs.replace(scene.environment, earth=False)))
        == 0
    )
    # the ground goes too far
    assert ground_drawings(_exposed(plan, 60.0)) == 0
    # a lens that sees past the Earth on both sides
    wide = replace(scene, camera=load_camera("fisheye-140"))
    assert ground_drawings(wide) == 0
    limb = plan_flight(load_scenario("tango-limb"), times=(30.0,)).scene(0)
    assert ground_drawings(replace(limb, exposure_s=0.1)) == 0


def test_the_first_smeared_picture_is_as_any_later_one(renderer, plan):
    scene = _exposed(plan, 0.2)
    later = integrate(renderer, scene, plan.target).radiance
    with Renderer() as fresh:
        first = integrate(fresh, scene, plan.target).radiance
    renderer.make_current()
    assert np.array_equal(first, later)
