"""A damaged cache costs time but does not change the image: every kind of file, truncated or altered."""

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from programs import completed

from flyaround.simulator.runtime.cache import cache_folder

pytestmark = pytest.mark.gl
SMALL = 4_000_000  # bytes: larger ones take seconds to make, and are the same to who reads them
PICTURE = """
import hashlib, json
from dataclasses import replace
from flyaround.simulator.runtime import cache
from flyaround.simulator.runtime import cached_arrays as arrays
from flyaround.simulator.targets import library
read, check = [], cache.map_checked
def watched(path):
    read.append(str(path))
    return check(path)
cache.map_checked = arrays.map_checked = watched
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario
scenario = load_scenario("tango-earth-10m-1024")
plan = plan_flight(scenario, n=1)
scene = replace(plan.scene(0), camera=scenario.camera_model.resized(128))
with Renderer() as renderer:
    radiance = renderer.render(scene, plan.target).radiance
print(json.dumps([hashlib.sha256(radiance.tobytes()).hexdigest(), read]))
"""


def picture(folder):
    """A frame's hash, and the cache's files that were asked for; by a program of its own, which remembers nothing."""
    done = completed(sys.executable, "-c", PICTURE, env={**os.environ, "FLYAROUND_CACHE_DIR": str(folder)})
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr, done.stderr
    told, read = json.loads(done.stdout.splitlines()[-1])
    return told, {Path(path).relative_to(folder) for path in read}


def damaged(whole, rng):
    """Emptied, cut short, with bits flipped: one of them at random."""
    kind, at = int(rng.integers(3)), rng.integers(1, len(whole), 3).tolist()
    if kind < 2:
        return whole[: at[0] * kind]
    data = bytearray(whole)
    for place in at:
        data[place] ^= 1 << int(rng.integers(8))
    return bytes(data)


def draw_with_damage(tmp_path, largest, seed):
    """Draw with damaged files in place of those of the usual cache up to a size; the kinds of files."""
    usual, rng = cache_folder(), np.random.default_rng(seed)
    right, read = picture(usual)  # what was not there is now
    broken = {}
    for name in sorted(read):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        if (usual / name).stat().st_size > largest:
            (tmp_path / name).symlink_to((usual / name).resolve())
            continue
        broken[name] = damaged((usual / name).read_bytes(), rng)
        (tmp_path / name).write_bytes(broken[name])
    assert picture(tmp_path)[0] == right
    # whole again, to the same bytes or but for a processor's own rounding
    assert not [name for name, data in broken.items() if (tmp_path / name).read_bytes() == data]
    return {name.name.split("-")[0] for name in broken}


def test_a_damaged_cache_gives_the_same_picture(tmp_path):
    kinds = draw_with_damage(tmp_path, SMALL, 1)
    assert kinds >= {"air", "edge", "season", "transfer", "ice"}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 5))
def test_a_cache_of_which_every_file_is_damaged_gives_the_same_picture(tmp_path, seed):
    kinds = draw_with_damage(tmp_path, 1e12, seed)
    assert kinds >= {"earth", "detail", "terrain", "geometry", "transfer"}
