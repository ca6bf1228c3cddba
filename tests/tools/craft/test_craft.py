"""Every built-in craft: closed bodies, labels on the mesh, public dimensions, a possible body's mass."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import msgspec
import numpy as np
import pytest
import trimesh

from flyaround.hil.board_model.write import record_without_faces
from flyaround.simulator.targets.library import built_in_targets, load_target
from flyaround.simulator.targets.model import DETAILS

Extents = tuple[float | None, float | None, float | None]


@dataclass(frozen=True, kw_only=True)
class Expected:
    """Figures of the public record.

    ``extents_m``: by prefix of part names ("" for all), the box about those parts (None: not published).
    ``triangles``: bounds at full detail.
    """

    extents_m: dict[str, Extents]
    mass_kg: tuple[float, float]
    triangles: tuple[int, int] = (20_000, 200_000)


BOARD = Expected(
    extents_m={"": (0.52, 0.40, 0.010), "squares": (0.44, 0.32, None)},
    triangles=(1_000, 3_000),
    mass_kg=(0.5, 3.0),
)
# tips of the antennas with their radius, rod and connector windows
TANGO = Expected(extents_m={"": (1.11, 1.088, 0.406)}, triangles=(15_000, 40_000), mass_kg=(40, 50.001))
EXPECTED = {
    "calibration-board": BOARD,
    # body about 1.5 m wide
    "change6-ascender": Expected(extents_m={"deck_upper": (1.5, 1.5, None)}, mass_kg=(700, 800)),
    "chessboard": BOARD,
    # CubeSat Design Specification rev. 14.1; SwissCube's antennas of 180 and 610 mm
    "cubesat-1u": Expected(
        extents_m={
            "rails": (0.100, 0.100, 0.1135),
            "antenna_uhf": (0.186, None, None),
            "antenna_vhf": (None, 0.616, None),
        },
        mass_kg=(0.82, 0.82),
    ),
    "cubesat-3u": Expected(extents_m={"rails": (0.100, 0.100, 0.3405)}, mass_kg=(3.9, 4.1)),
    "cubesat-6u": Expected(extents_m={"rails": (0.2263, 0.100, 0.366)}, mass_kg=(9.5, 10.5)),
    # docking plane to trunk; the closed nose cone has a test of its own
    "dragon": Expected(
        extents_m={"": (None, None, 7.6), "heat_shield": (4.0, 4.0, None)}, mass_kg=(12_400, 12_600)
    ),
    # on orbit, without the nose cap's 1.1 m of the 7.2 m at launch
    "dragon-cargo": Expected(
        extents_m={"": (16.5, None, 7.2 - 1.1), "heat_shield": (3.66, 3.66, None)}, mass_kg=(7000, 10_000)
    ),
    # ESA: bus 10 x 2.75 x 1.6 m, array 14 x 5 m, ASAR antenna 10 x 1.3 m, 26 m long as deployed
    "envisat": Expected(
        extents_m={
            "": (26.0, 10.0, None),
            "payload_beams": (7.4, 2.75, 1.6),
            "service_module": (2.6, 2.75, 1.6),
            "asar_tiles": (None, 10.0, None),
            "array_board": (14.0, None, None),
        },
        mass_kg=(7_800, 8_211),
    ),
    "soyuz-ms": Expected(
        extents_m={"": (10.7, None, 7.48), "service_skirt": (2.72, 2.72, None)}, mass_kg=(7000, 7150)
    ),
    "tango": TANGO,
    "tango-mli": TANGO,
    "tango-mockup": TANGO,
    # thesis: panel 570 x 759 mm, body 560 x 550 x 300 mm
    "tango-thesis": Expected(
        extents_m={"panel_frame": (0.570, 0.759, None), "body": (0.560, 0.550, 0.300)}, mass_kg=(40, 50.001)
    ),
    "tianzhou": Expected(
        extents_m={"": (14.9, None, 10.6), "cargo_shell": (3.35, 3.35, None)}, mass_kg=(12_900, 13_600)
    ),
}
BOARDS = ("calibration-board", "chessboard")
ROUND = ("dragon", "dragon-cargo", "soyuz-ms", "tianzhou")

load = functools.cache(load_target)


@pytest.fixture(params=EXPECTED)
def craft(request):
    return load(request.param, "full")


def joined(part):
    mesh = trimesh.Trimesh(part.positions_m.astype(float), part.triangles, process=False)
    mesh.merge_vertices(merge_norm=True, merge_tex=True)
    return mesh


def vertices(target, prefix=""):
    return np.concatenate([p.positions_m for p in target.parts if p.name.startswith(prefix)]).astype(float)


class Surface:
    """Triangles of a craft with the boxes about them."""

    def __init__(self, target):
        corners = np.concatenate([p.positions_m.astype(float)[p.triangles] for p in target.parts])
        self.corners, self.low, self.high = (
            corners,
            corners.min(axis=1).T.copy(),
            corners.max(axis=1).T.copy(),
        )

    def near(self, low, high):
        """Triangles (K, 3, 3) whose box meets the one between two corners."""
        kept = np.flatnonzero((self.low[0] < high[0]) & (self.high[0] > low[0]))
        for axis in (1, 2):
            kept = kept[(self.low[axis][kept] < high[axis]) & (self.high[axis][kept] > low[axis])]
        return self.corners[kept]

    def distance(self, points, reach_m):
        """Distance of points (K, 3) to the nearest triangle, by barycentric clamping; at most ``reach_m``."""
        best = np.full(len(points), reach_m)
        for k, q in enumerate(points):
            near = self.near(q - reach_m, q + reach_m)
            if len(near):
                closest = trimesh.triangles.closest_point(near, np.tile(q, (len(near), 1)))
                best[k] = min(reach_m, np.linalg.norm(closest - q, axis=1).min())
        return best


def test_every_craft_is_listed():
    assert built_in_targets() == tuple(EXPECTED)


@pytest.mark.parametrize("detail", DETAILS)
@pytest.mark.parametrize("name", EXPECTED)
def test_parts_are_closed_outward_and_shaded_as_wound(name, detail):
    # smoothing spans 32 degrees; a ring of eight facets adds half a facet of 45 degrees, a rod of four facets at
    # low detail turns its smoothed normals by 45 degrees
    widest = 56 if name in ROUND else 40 if detail == "full" else 46
    for part in load(name, detail).parts:
        mesh = joined(part)
        assert mesh.is_watertight, part.name
        assert mesh.is_winding_consistent, part.name
        p = part.positions_m.astype(float)[part.triangles]
        # the signed volume of every connected body is positive: outward, not merely consistent
        labels = trimesh.graph.connected_component_labels(mesh.face_adjacency, len(mesh.faces))
        volume = np.bincount(labels, np.einsum("ij,ij->i", p[:, 0], np.cross(p[:, 1], p[:, 2])) / 6)
        assert volume.min() > 0, part.name
        face = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        area = np.linalg.norm(face, axis=1) / 2
        assert area.min() > 1e-10, part.name  # 0.01 mm on a side
        lean = np.einsum("ij,ikj->ik", face / (2 * area[:, None]), part.normals.astype(float)[part.triangles])
        assert lean.min() > np.cos(np.deg2rad(widest)), part.name


def test_size_is_the_public_one(craft):
    for prefix, extents in EXPECTED[craft.name].extents_m.items():
        size = np.ptp(vertices(craft, prefix), axis=0)
        for k, expected in enumerate(extents):
            if expected is not None:
                assert size[k] == pytest.approx(expected, rel=0.02), (prefix, "xyz"[k])


def test_triangles_names_and_materials(craft):
    low, high = EXPECTED[craft.name].triangles
    assert low <= sum(len(p.triangles) for p in craft.parts) <= high
    names = [p.name for p in craft.parts]
    assert len(set(names)) == len(names)
    assert {p.material for p in craft.parts} == {m.name for m in craft.materials}
    assert len(craft.notes) > 100
    assert craft.frames
    for _, axis in craft.frames.values():
        assert np.linalg.norm(axis) == pytest.approx(1)


@pytest.mark.parametrize("name", EXPECTED)
def test_levels_differ_in_geometry_alone(name):
    full, medium, low = (load(name, d) for d in DETAILS)
    counts = [sum(len(p.triangles) for p in t.parts) for t in (full, medium, low)]
    for coarse in (medium, low):
        assert coarse.keypoints == full.keypoints
        assert coarse.wireframe == full.wireframe
        assert coarse.mass == full.mass
        assert coarse.frames == full.frames
        assert np.array_equal(coarse.occluders.vertices_m, full.occluders.vertices_m)
        if name not in ROUND:  # their antennas are left out
            assert np.allclose(np.ptp(vertices(coarse), axis=0), np.ptp(vertices(full), axis=0), rtol=0.03)
    if name in BOARDS:
        assert counts[0] == counts[2]
        assert full.sha256 == low.sha256
    else:
        assert counts[1] < 0.6 * counts[0]
        assert counts[2] < 0.55 * counts[1]
        assert len({t.sha256 for t in (full, medium, low)}) == 3


@pytest.mark.parametrize("detail", DETAILS)
@pytest.mark.parametrize("name", EXPECTED)
def test_every_keypoint_lies_on_the_mesh(name, detail):
    target = load(name, "full" if name == "soyuz-ms" else detail)  # its coarse levels have no mast
    points = np.array([k.position_m for k in target.keypoints])
    away = Surface(target).distance(points, 0.1)
    # 1 mm, or the rounding of float32 vertices and of turned planes on a craft of 26 m
    most = 1e-6 if EXPECTED[name] is TANGO else 1e-3
    assert not {k.name: round(d, 7) for k, d in zip(target.keypoints, away, strict=True) if d > most}
    assert len(np.unique(np.round(points, 3), axis=0)) == len(points) >= 12
    if name not in BOARDS:
        assert (np.ptp(points, axis=0) / np.ptp(vertices(target), axis=0)).min() > 0.5


def test_wireframe_lies_on_the_mesh(craft):
    surface = Surface(craft)
    names = [e.name for e in craft.wireframe]
    assert len(set(names)) == len(names)
    for edge in craft.wireframe:
        a, b = np.array(edge.a_m), np.array(edge.b_m)
        away = surface.distance(a + np.linspace(0.03, 0.97, 5)[:, None] * (b - a), edge.radius_m + 0.02)
        if edge.radius_m > 0:
            # a rod is drawn by its axis, within its mean radius of the surface
            assert away.max() < edge.radius_m + 0.003, edge.name
            assert not edge.normals
            continue
        # gaps of 20 mm between the panels of Envisat's array: at most half of one away from either
        gap = {"array": 0.0101, "asar": 0.0075}.get(edge.name.split("_")[0], 1e-3)
        assert away.max() < (gap if craft.name == "envisat" else 1e-3), edge.name
        normals = np.array(edge.normals)
        assert np.allclose(np.linalg.norm(normals, axis=1), 1)
        assert np.abs(normals @ (b - a)).max() < 1e-9


@pytest.mark.parametrize("name", ROUND)
def test_both_faces_of_an_edge_are_on_the_mesh(name):
    target = load(name, "full")
    surface = Surface(target)
    wrong = []
    for edge in target.wireframe:
        middle = (np.array(edge.a_m) + np.array(edge.b_m)) / 2
        close = surface.near(middle - 1e-3, middle + 1e-3)
        on = trimesh.triangles.closest_point(close, np.tile(middle, (len(close), 1)))
        close = close[np.linalg.norm(on - middle, axis=1) < 1e-3]
        face = np.cross(close[:, 1] - close[:, 0], close[:, 2] - close[:, 0])
        face /= np.linalg.norm(face, axis=1, keepdims=True)
        # the normals stored are those of the facets, but for float32 and millimetre-wide steps
        if len(edge.normals) != 2 or (face @ np.array(edge.normals).T).max(axis=0).min() < np.cos(0.05):
            wrong.append(edge.name)
    assert wrong == []


@pytest.mark.parametrize("name", ROUND)
def test_docking_and_grasp_frames(name):
    target = load(name, "full")
    origin, axis = target.frames["docking"]
    assert axis == (0.0, 0.0, 1.0)
    rims = [k.position_m[2] for k in target.keypoints if k.name.startswith(("port_", "collar_"))]
    assert len(rims) == 4
    assert rims == pytest.approx([origin[2]] * 4)
    grasp, out = target.frames["grasp"]
    assert np.linalg.norm(out) == pytest.approx(1)
    # half a metre along its axis a gripper is free of the craft's hull or within its hollow trunk
    assert Surface(target).distance(np.array([np.add(grasp, 0.5 * np.array(out))]), 0.02) == 0.02


def test_mass_is_that_of_a_possible_body(craft):
    low, high = EXPECTED[craft.name].mass_kg
    assert low - 1e-9 <= craft.mass.mass_kg <= high
    inertia = np.array(craft.mass.inertia_kg_m2)
    assert np.array_equal(inertia, inertia.T)
    moments = np.linalg.eigvalsh(inertia)
    assert moments[0] > 0
    assert moments[2] <= moments[0] + moments[1] + 1e-9 * moments[2]
    hull = trimesh.convex.convex_hull(vertices(craft))
    offsets = np.einsum("ij,ij->i", hull.face_normals, np.array(craft.mass.com_m) - hull.triangles[:, 0])
    assert offsets.max() < 0
    # no body inside the hull turns harder than all its mass at its furthest vertex
    reach = np.linalg.norm(hull.vertices - craft.mass.com_m, axis=1).max()
    assert moments[2] < craft.mass.mass_kg * reach**2


def test_occluders_are_few_closed_and_within_the_mesh(craft):
    o = craft.occluders
    assert len(o.triangles) <= 400
    mesh = trimesh.Trimesh(o.vertices_m, o.triangles, process=False)
    assert mesh.is_winding_consistent
    assert min(b.volume for b in mesh.split()) > 0
    everything = vertices(craft)
    assert (o.vertices_m.min(axis=0) >= everything.min(axis=0) - 1e-3).all()
    assert (o.vertices_m.max(axis=0) <= everything.max(axis=0) + 1e-3).all()


def test_keypoints_are_not_swallowed_by_occluders(craft):
    """A point inside a closed body could never be seen: those of the labels lie on or outside all of them."""
    o = craft.occluders
    for body in trimesh.Trimesh(o.vertices_m, o.triangles, process=False).split():
        # the bodies are convex: inside means behind every face
        for k in craft.keypoints:
            if "root" in k.name and craft.name.startswith("tango"):
                continue  # antenna roots lie on the body's corner, within the mount
            offset = np.einsum("ij,ij->i", body.face_normals, np.array(k.position_m) - body.triangles[:, 0])
            if body.is_convex:
                assert offset.max() > -2e-3, k.name


def test_board_file_is_small(craft):
    # read by a small board at start: a tenth of a second at most
    assert len(msgspec.json.encode(record_without_faces(craft))) < 200_000
