"""What places on a craft see of it: form factors by two ray casters, and low relief that does not darken."""

import numpy as np
import pytest
import trimesh

from flyaround.simulator.baking.baked_visibility import (
    trace_visibility,
)
from flyaround.simulator.baking.charts import make_charts
from flyaround.simulator.geometry.directions import spherical_fibonacci
from flyaround.simulator.geometry.ray_cast import EmbreeCaster, GridCaster


def of_mesh(mesh):
    return np.asarray(mesh.vertices)[np.asarray(mesh.faces)]


def looked(mesh, texel_m, caster=EmbreeCaster):
    """Charts of a mesh without smooth normals, and what their nodes see."""
    corners = of_mesh(mesh)
    normals = np.repeat(mesh.face_normals, 3, axis=0)
    triangles = np.arange(3 * len(corners)).reshape(-1, 3)
    points = corners.reshape(-1, 3)
    charts = make_charts(points, normals, np.zeros(len(points)), triangles, texel_m)
    radius = float(np.linalg.norm(points, axis=1).max())
    planes = np.asarray(mesh.face_normals, np.float32)
    return charts, trace_visibility(charts, planes, caster(corners), spherical_fibonacci(128), radius)


def open_share(seen):
    return (seen.cosines * seen.is_open).sum(axis=1) / seen.cosines.sum(axis=1)


@pytest.mark.parametrize("caster", [EmbreeCaster, GridCaster])
def test_a_disc_above_a_place_hides_its_form_factor_of_the_sky(caster):
    if caster is EmbreeCaster:
        pytest.importorskip("embreex")
    plate = trimesh.creation.box(extents=(0.02, 0.02, 0.001))
    disc = trimesh.creation.cylinder(1.0, 0.01, sections=64)
    for height in (0.5, 2.0) if caster is EmbreeCaster else (1.0,):
        whole = trimesh.util.concatenate([plate, disc.copy().apply_translation((0, 0, height + 0.005))])
        charts, seen = looked(whole, 0.3, caster)
        top = (charts.face_normals[charts.chart][:, 2] > 0.9) & (np.abs(charts.places_m[:, 2]) < 0.01)
        # differential area to a coaxial disc: r^2 / (r^2 + h^2), e.g. Howell's catalogue B-11
        assert open_share(seen)[top] == pytest.approx(1 - 1 / (1 + height**2), abs=0.02)


def test_a_sheet_under_low_tiles_is_as_bright_in_the_gaps_as_one_without():
    sheet = trimesh.creation.box(extents=(2.0, 2.0, 0.02))
    tiles = [
        trimesh.creation.box(extents=(0.19, 0.19, 0.002), transform=at)
        for at in (
            trimesh.transformations.translation_matrix((0.2 * i, 0.2 * j, 0.0115))
            for i in range(-4, 5)
            for j in range(-4, 5)
        )
    ]
    charts, seen = looked(trimesh.util.concatenate([sheet, *tiles]), 0.05)
    of_sheet = (charts.face_normals[charts.chart][:, 2] > 0.9) & (charts.places_m[:, 2] < 0.0101)
    assert of_sheet.sum() > 1000
    assert np.median(open_share(seen)[of_sheet]) > 0.99
    # a tall box in place of the tiles hides what it stands on
    box = trimesh.creation.box(extents=(1.0, 1.0, 1.0))
    charts, seen = looked(trimesh.util.concatenate([sheet, box.apply_translation((0, 0, 0.511))]), 0.05)
    under = (np.abs(charts.places_m[:, :2]).max(axis=1) < 0.45) & (
        np.abs(charts.places_m[:, 2] - 0.01) < 1e-4
    )
    assert under.any()
    assert open_share(seen)[under & (charts.face_normals[charts.chart][:, 2] > 0.9)].max() < 0.01
