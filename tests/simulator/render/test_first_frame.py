"""Compilation and prefetched maps do not change the first frame."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.bench import start
from flyaround.simulator.render.earth.map_textures import prefetch_earth_maps
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.cache import cache_folder
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

pytestmark = pytest.mark.gl


@pytest.mark.parametrize(
    ("bands", "name", "software", "layer"),
    [
        ("mono", "tango-earth-10m-1024", True, "all"),
        ("rgb", "tango-flyaround", True, "all"),
        ("mono", "tango-limb", False, "all"),
        # as a picture with motion over passing ground begins: the ground is drawn before the craft
        ("mono", "tango-earth-10m-1024", True, "sky"),
    ],
)
def test_the_first_frame_is_the_same_as_the_next(bands, name, software, layer):
    scenario = load_scenario(name)
    plan = plan_flight(scenario, n=1, bands=bands)
    scene = replace(plan.scene(0), camera=scenario.camera_model.resized(128))
    prefetched = prefetch_earth_maps(bands, scenario.environment.layers(), scene.epoch_utc)
    with Renderer(prefetched={bands: prefetched}, software_path=software) as renderer:
        first = renderer.render(scene, plan.target, layer=layer).radiance
        again = renderer.render(scene, plan.target, layer=layer).radiance
    assert np.isfinite(first).all()
    np.testing.assert_array_equal(first, again)


def test_the_bench_starts_a_program_that_draws():
    elapsed_ms, peak_mb = start.start_once(str(cache_folder()))
    assert elapsed_ms > 300
    assert 300 < peak_mb < 1500


FRAME = """
import hashlib
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.render.software.smooth_earth import SmoothEarthPass
from flyaround.simulator.scenario.load import load_scenario
plan = plan_flight(load_scenario("tango-earth-10m-1024"), n=1)
with Renderer() as renderer:
    print(hashlib.sha256(renderer.render(plan.scene(0), plan.target).radiance.tobytes()).hexdigest())
"""


@pytest.mark.slow
def test_frame_does_not_depend_on_the_cache(tmp_path):
    caches = {"FLYAROUND_CACHE_DIR": str(tmp_path), "MESA_SHADER_CACHE_DIR": str(tmp_path / "shaders")}
    made, kept = (
        subprocess.check_output([sys.executable, "-c", FRAME], env=os.environ | caches) for _ in range(2)
    )
    assert made == kept
    assert list(tmp_path.glob("earth-*.npy"))
