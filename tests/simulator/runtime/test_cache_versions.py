"""Cached results are what they were, or the version of their maker was raised.

A cache entry is named by a version that is raised by hand. Each maker's output for a small input is held here against a
summary of it; where both differ, the version must be raised and the summary written anew:
``FLYAROUND_WRITE_SUMMARIES=1 pytest tests/simulator/runtime/test_cache_versions.py``. What is shipped ready
made is held against its makers by test_prebuilt.py.
"""

import base64
import hashlib
import json
import os
import zlib
from pathlib import Path

import numpy as np
import pytest

from flyaround.hil.board_model import write
from flyaround.simulator.baking import baked_mesh, radiance_transfer
from flyaround.simulator.celestial import craters, detail_noise, sea_ice, seasons
from flyaround.simulator.celestial import earth_maps as maps
from flyaround.simulator.render.craft.mesh import prepared
from flyaround.simulator.render.gl import mipmaps
from flyaround.simulator.render.moon import moon_pass
from flyaround.simulator.runtime.prebuilt import without_prebuilt
from flyaround.simulator.targets.library import load_target

FILE = Path(__file__).with_name("cache_versions.json")
SMALL = "cubesat-1u@low"


def outer_faces():
    """Faces of the board file."""
    record = write.make_faces([load_target(SMALL).parts])
    return [np.array(record.material), np.array(record.step_m), unpacked(record.corners, "<i2")]


def outlines():
    """Outlines of the board file."""
    record = write.packed(write.outlines_of(load_target(SMALL)))
    return [np.array([record.views, record.points, record.range_m]), unpacked(record.data, "i1")]


def unpacked(text, dtype):
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), dtype)


def light():
    """Light between the parts of a small craft, by what its nodes see."""
    mesh = prepared(load_target(SMALL))[0]
    gray = np.full((len(mesh.charts.chart), 1), 0.5)
    return radiance_transfer.solve_radiosity(
        mesh.charts, radiance_transfer._traced_visibility(mesh), gray, closed=mesh.is_closed
    )


def earth_maps():
    """Both packed maps."""
    first = maps._pack_panchromatic()
    return [first, maps._pack_colour(maps.day_map(), first[..., 3])]


MAKERS = {
    "faces": (write.FACES_VERSION, outer_faces),
    "outlines": (write.OUTLINES_VERSION, outlines),
    "geometry": (baked_mesh.VERSION, lambda: [prepared(load_target(SMALL))[0].values]),
    "transfer": ((radiance_transfer.VISIBILITY_VERSION, radiance_transfer.VERSION), light),
    "ice": (sea_ice.VERSION, lambda: [sea_ice._make_ice_noise(0)]),
    "detail": (detail_noise.VERSION, lambda: [detail_noise.make_detail()]),
    "seasons": (seasons.VERSION, lambda: [seasons._make_ground_slopes(), *seasons._make_gains((1,), 3)]),
    "mipmaps": (mipmaps.VERSION, lambda: [mipmaps._smaller(np.eye(64, dtype=np.uint8) * 255, globe=True)]),
    "moon": (moon_pass.MAP_VERSION, lambda: [moon_pass.moon_map()]),
    "craters": (craters.VERSION, lambda: [craters.make_craters(craters.FINE_LARGEST_PX)]),
    "maps": (maps.VERSION, earth_maps),
}
SLOW = {"craters", "maps"}


def summary(made):
    """Of each array its shape, type, mean, root mean square and projections on two waves; of a text its hash."""
    told = []
    for one in made:
        if isinstance(one, str):
            told.append(hashlib.sha256(one.encode()).hexdigest()[:16])
            continue
        flat = np.ravel(one)
        x = flat[:: flat.size // 200_000 | 1].astype(float)  # of the largest every so many values
        k = np.arange(x.size)
        numbers = [
            x.mean(),
            np.sqrt((x * x).mean()),
            (x * np.sin(k)).mean(),
            (x * np.cos(0.7 * k + 1)).mean(),
        ]
        told.append([list(np.shape(one)), np.asarray(one).dtype.kind, *(float(f"{v:.6g}") for v in numbers)])
    return told


def same(a, b):
    """Two summaries agree but for what processors round otherwise."""
    if len(a) != len(b):
        return False
    for x, y in zip(a, b, strict=True):
        if isinstance(x, str) or isinstance(y, str):
            if x != y:
                return False
        # rays along edges hit other faces on processors without AVX-512: 0.3 % of the root mean square of light
        elif x[:2] != y[:2] or not np.allclose(x[2:], y[2:], rtol=0, atol=5e-3 * y[3] + 1e-9):
            return False
    return True


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in SLOW)) for n in MAKERS])
def test_a_maker_whose_output_changes_has_a_new_version(name, tmp_path, monkeypatch):
    version, make = MAKERS[name]
    version = list(version) if isinstance(version, tuple) else version
    monkeypatch.setenv("FLYAROUND_CACHE_DIR", str(tmp_path))  # nothing is taken from the user's cache
    with without_prebuilt():
        now = summary(make())
    known = json.loads(FILE.read_text()) if FILE.is_file() else {}
    if os.environ.get("FLYAROUND_WRITE_SUMMARIES"):
        known[name] = {"version": version, "output": now}
        FILE.write_text(json.dumps(known, indent=0, sort_keys=True) + "\n")
    was = known[name]
    if was["version"] == version:
        assert same(now, was["output"]), (
            f"the output of {name} is another: raise the version beside its maker"
        )
    else:
        pytest.fail(f"the version of {name} was raised: write its summary anew (this file's head says how)")
