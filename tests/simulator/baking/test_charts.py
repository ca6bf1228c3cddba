"""Charts of a mesh: the mesh stays as it was, and every place finds its node."""

import numpy as np
import trimesh

from flyaround.simulator.baking.charts import make_charts


def charts_of(mesh, texel_m):
    triangles = np.asarray(mesh.faces, int)
    normals = np.asarray(mesh.vertex_normals, float)
    return make_charts(np.asarray(mesh.vertices, float), normals, np.zeros(len(normals)), triangles, texel_m)


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
    monkeypatch.setattr("flyaround.simulator.baking.charts.MAX_NODES", 4000)
    rng = np.random.default_rng(3)
    corners = rng.uniform(-1, 1, (9000, 1, 3)) + rng.normal(size=(9000, 3, 3)) * 0.02
    dust = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(27000).reshape(-1, 3), process=False)
    charts = charts_of(dust, 0.03)
    assert len(charts.chart) <= 4000
    assert np.isfinite(charts.places_m).all()
    assert np.isfinite(charts.normals).all()
