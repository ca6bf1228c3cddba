"""Outlines of known bodies from all sides, packed and read back by the board's own code."""

import json
import time

import msgspec
import numpy as np
import pytest

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation import BoardModel
from flyaround.hil.board.estimation.occluding_contours import Outlines
from flyaround.hil.board_model.contours import outlines_of
from flyaround.hil.board_model.write import pack_contours, write_board_model
from flyaround.simulator.targets.library import load_target
from tools.craft.assemble import Piece, assemble
from tools.craft.mass import MassElement
from tools.craft.shapes.mesh import merge
from tools.craft.shapes.solids import box, lathe


def body(mesh):
    return assemble(
        "body", "body", pieces=[Piece("body", "white-paint", mesh)],
        keypoints={}, wireframe=[], occluders=[mesh], frames={}, notes="",
        lumps=[MassElement("b", 1.0, (0, 0, 0), size_m=(1, 1, 1))],
    )  # fmt: skip


def read(target, views=60):
    return Outlines.from_dict(msgspec.to_builtins(pack_contours(outlines_of(target, views))))


def slid(outlines, view, lean_rad, range_m):
    """Points and normals of a view as a camera sees them that has moved aside, and the lines of sight."""
    d = outlines.directions[view]
    aside = np.cross(d, np.eye(3)[int(np.argmin(np.abs(d)))])
    C = range_m * (np.cos(lean_rad) * d + np.sin(lean_rad) * aside / np.linalg.norm(aside))
    p, n = outlines.seen_from(view, C)
    sight = C - p
    return p, n, sight / np.linalg.norm(sight, axis=1, keepdims=True)


def sphere(radius_m):
    t = np.linspace(-np.pi / 2, np.pi / 2, 49)
    profile = [(radius_m * np.cos(x), radius_m * np.sin(x)) for x in t]
    profile[0], profile[-1] = (0.0, -radius_m), (0.0, radius_m)
    return lathe(profile, (0, 0, 0), (0, 0, 1), 96)


@pytest.mark.parametrize(("lean_deg", "range_m"), [(0, 20.0), (9, 8.0), (9, 60.0)])
def test_outline_of_a_sphere_slides_as_it_must(lean_deg, range_m):
    outlines = read(body(sphere(2.0)))
    assert np.allclose(outlines.radius_m, 2.0, atol=0.02)
    for view in range(0, 60, 7):
        p, n, sight = slid(outlines, view, np.deg2rad(lean_deg), range_m)
        # the mesh's silhouette runs along its facets, up to 3 degrees from the sphere's
        assert np.linalg.norm(p, axis=1) == pytest.approx(2.0, abs=0.03)
        assert np.linalg.norm(p, axis=1).mean() == pytest.approx(2.0, abs=0.005)
        # on the contour the surface looks neither at the camera nor away from it
        assert np.abs(np.einsum("ij,ij->i", p, sight)).max() < 0.11
        assert np.abs(n - p / 2.0).max() < 0.06


def test_curvature_is_that_of_the_body():
    # a small ball far from a large box: its radius stays below the limit
    outlines = read(body(merge([sphere(0.25), box((-2, -2, -2), (2, 2, -1))])))
    away = np.linalg.norm(outlines.points_m, axis=-1)
    ball = away < 0.26
    assert ball.sum() > 100
    assert outlines.radius_m[ball] == pytest.approx(0.25, abs=0.02)
    assert outlines.radius_m[~ball].max() == 0.0
    # a cylinder of radius r seen at angle a to its axis curves with r / sin^2 a along the sight
    rod = read(body(lathe([(0, -3), (0.4, -3), (0.4, 3), (0, 3)], (0, 0, 0), (0, 0, 1), 64)))
    sight = rod.centre_m + rod.range_m * rod.directions[:, None] - rod.points_m
    sine2 = 1 - sight[..., 2] ** 2 / (sight**2).sum(axis=-1)
    side = (np.abs(rod.points_m[..., 2]) < 2.8) & (rod.radius_m < 2.8)
    assert side.sum() > 500
    assert (rod.radius_m * sine2)[side] == pytest.approx(0.4, rel=0.03)


def test_outline_is_outermost_and_evenly_spread():
    low, high = np.array((-1.0, -0.5, -0.3)), np.array((1.0, 0.5, 0.3))
    inner = box((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2))
    outlines = read(body(merge([box(low, high), inner])))
    assert outlines.radius_m.max() == 0
    corners = np.array([[(low, high)[k][i] for i, k in enumerate(s)] for s in np.ndindex(2, 2, 2)])
    for view in range(60):
        C = outlines.centre_m + outlines.range_m * outlines.directions[view]
        sight = corners[None] - outlines.points_m[view][:, None]
        # nothing of a convex body lies outside the plane through eye, point and the outline's tangent
        beyond = np.einsum("njk,nk->nj", sight, outlines.normals[view])
        assert beyond.max() < 0.012
        gaps = np.linalg.norm(np.diff(outlines.points_m[view], axis=0), axis=1)
        assert np.median(gaps) < 0.12
        assert np.abs(np.einsum("nk,nk->n", C - outlines.points_m[view], outlines.normals[view])).max() < 0.1


def test_board_file_carries_outlines_and_an_old_one_does_not(tmp_path):
    target = load_target("soyuz-ms")
    path = tmp_path / "soyuz.board.json"
    start = time.process_time()
    write_board_model(target, path)
    first = time.process_time() - start
    # 10 s of one core here; a slower one, shared with others, may take several times as long
    assert first < 100
    assert path.stat().st_size < 300_000
    start = time.process_time()
    write_board_model(target, path)
    assert time.process_time() - start < 1.0  # kept by the target's hash
    model = BoardModel.read(path)
    assert model.outlines is not None
    assert model.outlines.points_m.shape == (200, 72, 3)
    assert (
        model.outlines.nearest(model.outlines.centre_m + 50 * model.outlines.directions) == range(200)
    ).all()
    # the orbital module, a spheroid of 2.2 m: smooth outlines with its curvature
    round_share = (model.outlines.radius_m > 0.3).mean()
    assert round_share > 0.1
    document = json.loads(path.read_text())
    del document["outlines"]
    path.write_text(json.dumps(document))
    assert BoardModel.read(path).outlines is None


@pytest.mark.parametrize(
    ("change", "message"),
    [({"data": "AAAA"}, "unpacked"), ({"views": 7}, "bytes instead of"), ({"step_m": None}, "bad field")],
)
def test_damaged_outlines_are_named(change, message):
    record = msgspec.to_builtins(pack_contours(outlines_of(body(box((-1, -1, -1), (1, 1, 1))), 4, 16)))
    edge = {"name": "e", "a_m": [0, 0, 0], "b_m": [1, 0, 0]}
    data = {
        "schema": "flyaround.board_model",
        "version": 1,
        "name": "b",
        "sha256": "0" * 64,
        "wireframe": [edge],
    }
    assert BoardModel.from_dict({**data, "outlines": record}).outlines is not None
    with pytest.raises(BoardModelError, match=message):
        BoardModel.from_dict({**data, "outlines": {**record, **change}})
