"""What is worked out of a mesh before it is uploaded: kept in the cache, and the same from there."""

import dataclasses
import json

import numpy as np
import pytest

from flyaround.simulator.baking import baked_mesh
from flyaround.simulator.baking.baked_mesh import VERTEX, MergedParts, geometry_of
from flyaround.simulator.baking.charts import TEXEL
from flyaround.simulator.geometry.convex_shells import Boxes
from flyaround.simulator.runtime.serialisation import pack, unpack
from flyaround.simulator.targets.library import load_target


def merged(target):
    blocks, triangles, start = [], [], 0
    for part in target.parts:
        block = np.zeros(len(part.positions_m), VERTEX)
        block["position_m"], block["normal"], block["material"] = part.positions_m, part.normals, 1
        blocks.append(block)
        triangles.append(part.triangles + start)
        start += len(block)
    none = np.zeros((0, 2), np.float32)
    return MergedParts(np.concatenate(blocks), np.concatenate(triangles).astype(np.uint32), none)


def arrays_of(tree, name=""):
    if dataclasses.is_dataclass(tree):
        for field in dataclasses.fields(tree):
            yield from arrays_of(getattr(tree, field.name), f"{name}.{field.name}")
    elif isinstance(tree, tuple):
        for k, one in enumerate(tree):
            yield from arrays_of(one, f"{name}.{k}")
    else:
        yield name, np.asarray(tree)


def test_a_fetched_geometry_is_the_one_that_was_made_and_an_edited_mesh_has_another(tmp_path, monkeypatch):
    monkeypatch.setenv("FLYAROUND_CACHE_DIR", str(tmp_path))
    target = load_target("cubesat-1u@low")
    numbers = dict.fromkeys((m.name for m in target.materials), 1)
    whole = merged(target)
    fresh = baked_mesh._make(whole, target.parts, numbers, TEXEL)
    made = geometry_of(whole, target.parts, numbers, TEXEL)
    monkeypatch.setattr(baked_mesh, "_make", None)  # not called again
    fetched = geometry_of(merged(target), target.parts, numbers, TEXEL)
    assert len(fetched.shells) > 0
    assert len(fetched.edges.ends) > 0
    for (name, a), (_, b), (_, c) in zip(*map(arrays_of, (fresh, made, fetched)), strict=True):
        assert a.dtype == b.dtype == c.dtype, name
        np.testing.assert_array_equal(a, b, name)
        np.testing.assert_array_equal(b, c, name)
    with pytest.raises(TypeError, match="NoneType"):
        geometry_of(whole, target.parts, numbers, 2 * TEXEL)
    whole.vertices["position_m"][0, 0] += 1e-3
    with pytest.raises(TypeError, match="NoneType"):
        geometry_of(whole, target.parts, numbers, TEXEL)


def test_what_is_packed_comes_back_and_nothing_but_data_is_packed():
    boxes = Boxes(np.arange(6, dtype=np.float32).reshape(6, 1), np.zeros(0, int))
    again = unpack(pack((boxes, None, True, 0.1, float("inf"), "a"), tuple, Boxes), tuple, Boxes)
    assert again[1:] == (None, True, 0.1, float("inf"), "a")
    np.testing.assert_array_equal(again[0].extents_m, boxes.extents_m)
    assert again[0].of.shape == (0,)
    assert again[0].of.dtype == boxes.of.dtype
    with pytest.raises(TypeError, match="not asked for"):
        unpack(pack(boxes, Boxes), tuple)
    for unfit in (json, np.array([json], object), {"a": 1}):
        with pytest.raises(TypeError, match="cannot be stored"):
            pack(unfit)
