"""Builders of round craft: wrapped plates, free-form bodies, nozzles and wings are closed and of their size."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from flyaround.simulator.targets.builders.creased import copies, creased
from flyaround.simulator.targets.builders.labels import plate_edges, rim_edges
from flyaround.simulator.targets.builders.mass import mass_properties
from flyaround.simulator.targets.builders.mesh import Mesh
from flyaround.simulator.targets.builders.solids import box
from flyaround.simulator.targets.builders.wing import Wing, wing_cells, wing_panels, wing_ribs, wing_yoke
from flyaround.simulator.targets.builders.wrapped import Revolved, pad, sector, tiled
from flyaround.simulator.targets.craft.level import Level
from flyaround.simulator.targets.craft.parts import bell, dish
from flyaround.simulator.targets.craft.round_mass import Tube

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
    edges = plate_edges("plate", [(0, 0), (2, 0), (2, 1), (0, 1)], 0.5, (0, 0, 0), (1, 0, 0), (0, 1, 0))
    assert len(edges) == 12
    middle = np.array([1.0, 0.5, 0.25])
    for e in edges:
        out = (np.array(e.a_m) + np.array(e.b_m)) / 2 - middle
        assert (np.array(e.normals) @ out > 0).all(), e.name


def test_thirds_of_segments_share_vertices() -> None:
    assert [Level(d).segments(72) for d in ("full", "medium", "low")] == [72, 48, 24]


def test_inertia_of_tubes() -> None:
    solid = mass_properties([Tube(name="drum", mass_kg=12.0, centre_m=(1, 2, 3), radius_m=2.0, length_m=1.0)])
    assert solid.com_m == (1, 2, 3)
    assert np.allclose(solid.inertia_kg_m2, np.diag([13.0, 13.0, 24.0]))
    hoop = mass_properties(
        [Tube(name="hoop", mass_kg=5.0, centre_m=(0, 0, 0), radius_m=2.0, length_m=1e-9, inner_m=2.0)]
    )
    assert hoop.inertia_kg_m2[2][2] == pytest.approx(5.0 * 4)
