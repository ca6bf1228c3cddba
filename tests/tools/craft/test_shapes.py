"""Shapes of tools/craft are closed, outward, wound with their normals, and of the size and volume they claim."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from flyaround.simulator.targets.model import DETAILS
from tools.craft.hardware import bell, dish
from tools.craft.labels import prism_edges, rim_edges
from tools.craft.level import Level, facets
from tools.craft.mass import Tube, mass_properties
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.prism import cell_grid, circle, clipped_rectangle, prism, rectangle, triangulate
from tools.craft.shapes.solids import bar, box, cone, dome, lathe, rod, truss
from tools.craft.shapes.wrapped import Revolved, copies, creased, pad, sector, tiled
from tools.craft.wings import Wing, wing_cells, wing_panels, wing_ribs, wing_yoke

N = 96
RING_AREA = N / 2 * np.sin(2 * np.pi / N)  # of a regular polygon in the unit circle

BODIES = {
    "box": (box((-1, -2, -3), (1, 2, 3)), 48.0),
    "bevelled box": (
        box((0, 0, 0), (1, 1, 1), 0.1),
        1 - 12 * 0.005 * 0.8 - 8 * (0.005 * 0.1 * 2 - 0.001 / 6),
    ),
    "bar": (bar((0, 0, 0), (1, 2, 2), 0.1, 0.2, (0, 0, 1)), 0.06),
    "cylinder": (cone((0, 0, 1), (0, 3, 1), 0.5, 0.5, N), 3 * 0.25 * RING_AREA),
    "cone": (cone((1, 0, 0), (1, 0, 2), 0.3, 0.1, N), 2 / 3 * RING_AREA * (0.09 + 0.03 + 0.01)),
    "point": (lathe([(0, 0), (0.5, 0), (0, 1)], (0, 0, 0), (1, 1, 0), N), RING_AREA * 0.25 / 3),
    "plate with holes": (
        prism(rectangle((0, 0), (4, 2)), 0.5, holes=[circle((1, 1), 0.3, N), circle((3, 1), 0.2, N)]),
        0.5 * (8 - RING_AREA * (0.09 + 0.04)),
    ),
    "arrow": (prism([(0, 0), (2, 1), (0, 2), (1, 1)], 1.0, u=(0, 1, 0), v=(0, 0, 1)), 1.0),
}

CYLINDER = Revolved.of([(2.0, -3.0), (2.0, 3.0)])
CONE = Revolved.of([(2.0, 0.0), (1.0, 2.0)])
WING = Wing(panels=3, first_m=1.0, length_m=1.0, gap_m=0.05, chord_m=2.0, thickness_m=0.03, cells=(5, 8))


def as_trimesh(mesh: Mesh) -> trimesh.Trimesh:
    tri = trimesh.Trimesh(mesh.positions_m, mesh.triangles, process=False)
    tri.merge_vertices(merge_norm=True, merge_tex=True)
    return tri


def assert_closed(mesh: Mesh) -> trimesh.Trimesh:
    tri = as_trimesh(mesh)
    assert tri.is_watertight
    assert tri.is_winding_consistent
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1)
    assert min(b.volume for b in tri.split(only_watertight=True)) > 0
    return tri


def test_sector_of_a_cylinder_has_its_volume() -> None:
    plate = sector(CYLINDER, (0.2, 1.4), [-1.0, 0.0, 1.0], 0.05, 0.10, 64)
    tri = assert_closed(plate)
    assert tri.volume == pytest.approx(1.2 / 2 * (2.05**2 - 1.90**2) * 2, rel=1e-3)
    radius = np.hypot(*plate.positions_m[:, :2].T)
    assert (radius.min(), radius.max()) == pytest.approx((1.90, 2.05))


def test_sector_keeps_its_edges_sharp_and_its_faces_smooth() -> None:
    plate = sector(CYLINDER, (0.0, 1.0), [-1.0, 1.0], 0.05, 0.10, 20)
    outer = np.hypot(*plate.positions_m[:, :2].T) > 2.04
    radial = (plate.normals[:, :2] * plate.positions_m[:, :2]).sum(axis=1) / np.hypot(
        *plate.positions_m[:, :2].T
    )
    kinds = radial[outer]
    # every vertex of the outer face looks outwards or belongs to a wall that stands on it
    assert ((kinds > 0.999) | (np.abs(kinds) < 0.03)).all()


@pytest.mark.parametrize("exponent", [2.0, 4.0])
@pytest.mark.parametrize("surface", [CYLINDER, CONE], ids=["cylinder", "cone"])
def test_pad_follows_its_surface(surface: Revolved, exponent: float) -> None:
    half, lift, sink = (0.30, 0.40), 0.02, 0.03
    plate = pad(surface, 0.7, 1.0, half, lift_m=lift, sink_m=sink, exponent=exponent, segments=96, rings=6)
    tri = assert_closed(plate)
    area = {2.0: np.pi, 4.0: 3.7081}[exponent] * half[0] * half[1]  # of |x|^n + |y|^n = 1
    assert tri.volume == pytest.approx(area * (lift + sink), rel=0.03)
    radius = np.hypot(*plate.positions_m[:, :2].T)
    tilt = np.hypot(1, float(surface.slope(1.0)))
    rise = (radius - surface.radius(plate.positions_m[:, 2])) / tilt
    assert rise.max() == pytest.approx(lift, abs=2e-3)
    assert rise.min() == pytest.approx(-sink, abs=2e-3)


def test_domed_pad_and_relief_raise_the_middle() -> None:
    dome = pad(CYLINDER, 0.0, 0.0, (0.3, 0.3), lift_m=0.01, dome_m=0.2)
    assert dome.positions_m[:, 0].max() == pytest.approx(2.21)
    step = pad(CYLINDER, 0.0, 0.0, (0.3, 0.3), lift_m=0.01, relief=lambda flat: np.full(len(flat), 0.4))
    assert step.positions_m[:, 0].max() == pytest.approx(2.41)
    assert_closed(dome)
    assert_closed(step)


def test_tiles_touch_the_surface_and_look_outwards() -> None:
    tile = box((-0.05, -0.04, 0.0), (0.05, 0.04, 0.01))
    field = tiled(CONE, [0.0, 0.5, 1.0], [0.5, 1.0], tile, 0.003)
    bodies = assert_closed(field).split()
    assert len(bodies) == 6
    first = np.asarray(bodies[0].vertices).mean(axis=0)
    radius = np.hypot(first[0], first[1])
    tilt = np.hypot(1, 0.5)
    assert (radius - float(CONE.radius(first[2]))) / tilt == pytest.approx(0.008, abs=1e-6)


def test_creased_cube_is_flat_and_ball_is_smooth() -> None:
    cube = trimesh.creation.box()
    mesh = creased(cube.vertices, cube.faces)
    assert len(mesh.positions_m) == 24
    assert np.allclose(np.abs(mesh.normals).max(axis=1), 1)
    ball = trimesh.creation.icosphere(subdivisions=3)
    smooth = creased(ball.vertices, ball.faces)
    assert len(smooth.positions_m) == len(ball.vertices)
    assert (smooth.normals * smooth.positions_m).sum(axis=1).min() > 0.999


def test_copies_are_turned_and_moved() -> None:
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    both = copies(box((0, 0, 0), (2, 1, 1)), [np.eye(3), quarter], [(0, 0, 0), (10, 0, 0)])
    assert as_trimesh(both).volume == pytest.approx(4)
    assert np.allclose(both.positions_m[8 * 3 :].min(axis=0), (9, 0, 0))


def test_nozzle_and_dish_open_the_way_they_look() -> None:
    nozzle = bell((0, 0, 0), (0, 0, -1), 0.5, 0.1, 0.3, 36)
    assert_closed(nozzle)
    assert nozzle.positions_m[:, 2].min() == pytest.approx(-0.5)
    low = nozzle.positions_m[nozzle.positions_m[:, 2] < -0.49]
    assert np.hypot(*low[:, :2].T).max() == pytest.approx(0.3 * 1.08)
    reflector = dish((1, 0, 0), (1, 0, 0), 0.5, 0.2, 36)
    assert_closed(reflector)
    # a viewer on the axis looks at the hollow side: normals of the inner vertices point to the axis
    inner = (reflector.normals[:, 0] > 0.1) & (reflector.positions_m[:, 0] > 1.05)
    towards = -(reflector.normals[:, 1:] * reflector.positions_m[:, 1:]).sum(axis=1)
    assert (towards[inner] > -1e-9).all()


def test_wing_has_its_panels_cells_and_span() -> None:
    assert WING.tip_m == pytest.approx(4.1)
    panels = assert_closed(wing_panels(WING))
    assert len(panels.split()) == 3
    counts = {"single": 3 * 5 * 8, "string": 3 * 5, "panel": 3}
    for grouping, count in counts.items():
        cells = wing_cells(WING, grouping)
        assert len(assert_closed(cells).split()) == count
        assert cells.positions_m[:, 2].min() == pytest.approx(0.015)
    for fitting in (wing_ribs(WING, 0.02, 3), wing_yoke(WING, 0.2, 0.5, 0.04)):
        assert_closed(fitting)


def test_rim_is_a_closed_polygon_with_normals_of_its_sides() -> None:
    rim = rim_edges("rim", 1.5, 2.0, [(1, 0), (0, 1)], segments=24)
    assert len(rim) == 24
    for edge, after in zip(rim, rim[1:] + rim[:1], strict=True):
        assert edge.b_m == after.a_m
        assert np.hypot(*edge.a_m[:2]) == pytest.approx(2.0)
        assert edge.normals[1] == pytest.approx((0, 0, 1))
        along = np.subtract(edge.b_m, edge.a_m)
        assert np.abs(np.array(edge.normals) @ along).max() < 1e-12


def test_edges_of_a_plate_are_those_of_its_prism() -> None:
    edges = prism_edges("plate", [(0, 0), (2, 0), (2, 1), (0, 1)], 0.5)
    assert len(edges) == 12
    middle = np.array([1.0, 0.5, 0.25])
    for e in edges:
        out = (np.array(e.a_m) + np.array(e.b_m)) / 2 - middle
        assert (np.array(e.normals) @ out > 0).all(), e.name


def test_thirds_of_segments_share_vertices() -> None:
    assert [Level(d).segments(72) for d in ("full", "medium", "low")] == [72, 48, 24]


def test_inertia_of_tubes() -> None:
    solid = mass_properties([Tube("drum", 12.0, (1, 2, 3), radius_m=2.0, length_m=1.0)])
    assert solid.com_m == (1, 2, 3)
    assert np.allclose(solid.inertia_kg_m2, np.diag([13.0, 13.0, 24.0]))
    hoop = mass_properties([Tube("hoop", 5.0, (0, 0, 0), radius_m=2.0, length_m=1e-9, inner_m=2.0)])
    assert hoop.inertia_kg_m2[2][2] == pytest.approx(5.0 * 4)


def test_facets_keep_the_quarters() -> None:
    for full in (8, 12, 16, 20, 24, 32, 40, 48, 64, 96):
        for level in DETAILS:
            n = facets(level, full)
            assert n % 4 == 0
            assert 4 <= n <= full
    assert facets("full", 10) == 10


@pytest.mark.parametrize("name", BODIES)
def test_body_is_closed_outward_and_of_its_volume(name: str) -> None:
    mesh, volume = BODIES[name]
    tri = as_trimesh(mesh)
    assert tri.is_watertight
    assert tri.is_winding_consistent
    # exact but for the rounding of coordinates: the expected volumes are those of the polygons
    assert tri.volume == pytest.approx(volume, rel=1e-9)


@pytest.mark.parametrize("name", BODIES)
def test_vertex_normals_are_unit_and_agree_with_the_winding(name: str) -> None:
    mesh, _ = BODIES[name]
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-12)
    p = mesh.positions_m[mesh.triangles]
    face = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    # at most 32 degrees between a facet and the smoothed normals at its corners
    assert (np.einsum("ij,ikj->ik", face, mesh.normals[mesh.triangles]) > np.cos(np.deg2rad(33))).all()


def test_creases_are_sharp_and_curved_sides_smooth() -> None:
    flat = box((0, 0, 0), (1, 1, 1))
    assert {tuple(np.abs(n)) for n in flat.normals} == {(1, 0, 0), (0, 1, 0), (0, 0, 1)}
    round_side = cone((0, 0, 0), (0, 0, 1), 1.0, 1.0, 32)
    side = np.abs(round_side.normals[:, 2]) < 0.5
    radial = round_side.positions_m[side] * (1, 1, 0)
    assert np.allclose(round_side.normals[side], radial, atol=1e-12)


def test_dome_normals_are_those_of_the_sphere() -> None:
    mesh = dome((0, 0, 0), (0, 0, 1), 1.0, 1.0, segments=48, rings=16)
    curved = mesh.normals[:, 2] > -0.5
    lean = np.einsum("ij,ij->i", mesh.normals[curved], mesh.positions_m[curved])
    # half a facet (2.8 degrees) at the rim, where the profile ends, is the most that smoothing leaves
    assert lean.min() > np.cos(np.deg2rad(3))


def test_truss_members_are_separate_closed_bodies() -> None:
    mesh = truss([(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0)], [(0, 1), (0, 2), (1, 2), (1, 3)], 0.01)
    tri = as_trimesh(mesh)
    assert tri.is_watertight
    assert len(tri.split()) == 4 + 4


def test_mirroring_keeps_a_body_outward() -> None:
    solid = rod((1, 0, 0), (1, 1, 0), 0.1)
    assert as_trimesh(solid.mirrored(0)).volume == pytest.approx(as_trimesh(solid).volume)
    assert solid.mirrored(0).positions_m[:, 0].max() < 0


def test_rotation_and_merge_keep_counts() -> None:
    turned = box((0, 0, 0), (1, 1, 1)).rotated([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    both = merge([turned, turned.moved((5, 0, 0))])
    assert len(both.triangles) == 24
    assert as_trimesh(both).volume == pytest.approx(2.0)


def test_crossing_holes_are_refused() -> None:
    bow = np.array([(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.2)])
    with pytest.raises(ValueError, match="crosses"):
        triangulate(bow)


def test_cells_stand_apart() -> None:
    tile = clipped_rectangle(0.08, 0.04, 0.01, "all")
    assert len(tile) == 8
    grid = cell_grid([0.0, 0.1], [0.0, 0.05, 0.1], tile, 1.0, 0.001)
    assert len(as_trimesh(grid).split()) == 6
    assert grid.positions_m[:, 2].min() == 1.0
