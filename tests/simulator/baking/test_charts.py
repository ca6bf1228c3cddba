"""Charts of a mesh: the mesh stays as it was, and every place finds its node."""

import numpy as np
import trimesh

from flyaround.simulator.baking.charts import make_charts


def charts_of(mesh, texel_m):
    triangles = np.asarray(mesh.faces, int)
    normals = np.asarray(mesh.vertex_normals, float)
    return make_charts(np.asarray(mesh.vertices, float), normals, np.zeros(len(normals)), triangles, texel_m)


def test_a_box_has_six_charts_and_stays_a_box():
    box = trimesh.creation.box(extents=(1.0, 0.5, 0.2))
    charts = charts_of(box, 0.05)
    assert charts.of_triangle.max() == 5
    assert np.array_equal(charts.origin[charts.triangles], box.faces)
    # nodes no farther apart than asked for, and each face's own
    assert charts.step_m.max() <= 0.05 + 1e-9
    assert len(np.unique(charts.at)) == len(charts.at)
    assert len(charts.at) >= 2 * (21 * 11 + 21 * 5 + 11 * 5)


def test_nodes_lie_on_the_mesh_and_are_found_again():
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.5)
    charts = charts_of(ball, 0.05)
    assert np.abs(np.linalg.norm(charts.places_m, axis=1) - 0.5).max() < 0.02
    assert (np.einsum("nc,nc->n", charts.normals, charts.places_m) > 0.45).all()
    box = trimesh.creation.box(extents=(1.0, 0.5, 0.2))
    flat = charts_of(box, 0.05)
    assert np.array_equal(flat.node_at(flat.triangle, flat.places_m), np.arange(len(flat.at)))


def test_a_vertex_is_at_its_place_in_the_atlas():
    box = trimesh.creation.box(extents=(1.0, 0.5, 0.2))
    charts = charts_of(box, 0.05)
    at = charts.uv * charts.size_px - 0.5
    node = np.rint(at[:, 1]).astype(int) * charts.size_px[0] + np.rint(at[:, 0]).astype(int)
    where = {int(a): k for k, a in enumerate(charts.at)}
    places = charts.places_m[[where[int(n)] for n in node]]
    # nodes at borders are sampled a little inside
    assert np.abs(places - np.asarray(box.vertices)[charts.origin]).max() < 0.01


def test_a_finely_meshed_barrel_has_patches_and_not_one_chart_around_it():
    # neighbours differ by half a degree, which counts as coplanar
    barrel = trimesh.creation.cylinder(1.0, 0.3, sections=720)
    side = np.abs(barrel.face_normals[:, 2]) < 0.5
    barrel = trimesh.Trimesh(barrel.vertices, barrel.faces[side])
    charts = charts_of(barrel, 0.1)
    assert len(charts.chart) < 0.6 * len(barrel.faces)
    facing = np.einsum("nc,nc->n", charts.normals, charts.face_normals[charts.chart])
    assert facing.min() > np.cos(np.deg2rad(15))
    assert np.abs(np.linalg.norm(charts.places_m[:, :2], axis=1) - 1).max() < 1e-3
    # a place's node is near it, whatever the triangle
    node = charts.node_at(np.arange(len(barrel.faces)), barrel.triangles_center)
    assert np.linalg.norm(charts.places_m[node] - barrel.triangles_center, axis=1).max() < 0.1


def test_dust_has_a_bounded_number_of_nodes(monkeypatch):
    monkeypatch.setattr("flyaround.simulator.baking.charts.MOST_NODES", 4000)
    rng = np.random.default_rng(3)
    corners = rng.uniform(-1, 1, (9000, 1, 3)) + rng.normal(size=(9000, 3, 3)) * 0.02
    dust = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(27000).reshape(-1, 3), process=False)
    charts = charts_of(dust, 0.03)
    assert len(charts.chart) <= 4000
    assert np.isfinite(charts.places_m).all()
    assert np.isfinite(charts.normals).all()
