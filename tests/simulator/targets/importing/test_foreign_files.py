"""PLY, OFF, COLLADA, 3MF and STEP files give the same model as their glTF equivalent."""

import io
import itertools
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.importing.add import ImportOptions, import_mesh, read_surface
from flyaround.simulator.targets.importing.read.mesh_file import read_mesh

SIZE_M = (1.0, 2.0, 3.0)
STEP_BOX = Path(__file__).parents[3] / "data" / "box_mm.stp"
"""A box of that size as planar faces, in millimetres (ISO 10303-21, AP214)."""
WEDGE = trimesh.creation.box(SIZE_M)
WEDGE.vertices[WEDGE.vertices[:, 2] > 0, 0] *= 0.5  # no axis is like another


def corners(model):
    """(8, 3) corners of all parts, sorted."""
    points = np.unique(np.round(np.concatenate([p.positions_m for p in model.parts]), 6), axis=0)
    return points[np.lexsort(points.T)]


def saved(path, mesh=WEDGE):
    kind = path.suffix[1:]
    # the exporters of PLY, OFF and COLLADA take a mesh, the others a scene
    whole = mesh if kind in {"ply", "off", "dae"} else trimesh.Scene({"wedge": mesh})
    data = whole.export(file_type=kind)
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


@pytest.mark.parametrize("name", ["a.ply", "a.off", "a.dae", "a.3mf"])
def test_corners_are_those_of_the_glb(tmp_path, name):
    expected = corners(read_mesh(saved(tmp_path / "a.glb")))
    model = read_mesh(saved(tmp_path / name))
    scale = 1e-3 if name.endswith("3mf") else 1.0  # 3MF counts millimetres unless it says otherwise
    np.testing.assert_allclose(corners(model), expected * scale, atol=1e-6)
    assert model.triangle_count == 12


def test_the_unit_and_axis_of_collada_are_taken(tmp_path):
    path = saved(tmp_path / "a.dae")
    text = path.read_text()
    assert "<up_axis>" in text or "</asset>" in text
    start, end = text.index("<asset>"), text.index("</asset>")
    asset = '<asset><unit name="centimeter" meter="0.01"/><up_axis>Z_UP</up_axis>'
    path.write_text(text[:start] + asset + text[end:])
    model = read_mesh(path)
    assert (model.up, model.in_metres) == ("z", True)
    np.testing.assert_allclose(
        corners(model), corners(read_mesh(saved(tmp_path / "a.glb"))) * 0.01, atol=1e-6
    )
    path.write_text(path.read_text().replace("Z_UP", "X_UP"))
    with pytest.raises(UserError, match="X_UP"):
        read_mesh(path)


def test_the_unit_of_3mf_is_taken(tmp_path):
    path = saved(tmp_path / "a.3mf")
    packed = io.BytesIO()
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(packed, "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name).replace(b'unit="millimeter"', b'unit="meter"'))
    path.write_bytes(packed.getvalue())
    *_, parts, lines = read_surface(path, ImportOptions())
    assert np.ptp(np.concatenate([p.positions_m for p in parts]), axis=0) == pytest.approx(SIZE_M)
    assert any("the unit that the 3MF file names" in line for line in lines)


def test_colours_of_faces_stay_apart(tmp_path):
    mesh = WEDGE.copy()
    mesh.visual.face_colors = np.where(mesh.face_normals[:, 2:] > 0.5, (255, 0, 0, 255), (0, 0, 255, 255))
    model = read_mesh(saved(tmp_path / "a.ply", mesh))
    colours = {
        tuple(np.round(model.materials[k].base_color, 2))
        for p in model.parts
        for k in np.unique(p.face_material)
    }
    assert colours == {(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)}


@pytest.mark.usefixtures("coarse_proposals")
@pytest.mark.parametrize(("unit", "factor"), [("MILLI", 1.0), ("CENTI", 10.0)])
def test_a_step_solid_is_meshed_in_its_unit(tmp_path, unit, factor):
    path = tmp_path / "a.stp"
    path.write_text(STEP_BOX.read_text().replace(".MILLI.", f".{unit}."))
    target, *_ = import_mesh(path, "box")
    size = np.ptp(np.concatenate([p.positions_m for p in target.parts]), axis=0)
    # Z points up in STEP, as in our files
    assert size == pytest.approx(np.multiply(SIZE_M, factor), rel=1e-5)
    assert len(target.keypoints) >= 8


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        *itertools.product(["a.ply", "a.off", "a.dae", "a.3mf", "a.step"], ["cut", "noise"]),
        ("a.ply", "empty"),
        ("a.off", "empty"),
    ],
)
def test_damaged_file_gives_a_one_sentence_error(tmp_path, name, damage):
    path = tmp_path / name
    whole = (STEP_BOX if name.endswith("step") else saved(path)).read_bytes()
    if damage == "cut":
        path.write_bytes(whole[: len(whole) // 2])
    elif damage == "noise":
        path.write_bytes(whole[:8] + np.random.default_rng(3).bytes(2000))
    else:
        path.write_bytes({"a.ply": b"ply\nformat ascii 1.0\nend_header\n", "a.off": b"OFF\n0 0 0\n"}[name])
    with pytest.raises(UserError) as told:
        read_mesh(path)
    assert str(path) in str(told.value)
    assert "Traceback" not in str(told.value)
    assert len(str(told.value)) < 600


EMPTY_3MF = (
    b'<model xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources/><build/></model>'
)
COLLADA = (
    b'<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>'
    b"<created>2020-01-01T00:00:00</created><modified>2020-01-01T00:00:00</modified></asset>%s</COLLADA>"
)
EMPTY_SCENE = (
    b'<library_visual_scenes><visual_scene id="s"/></library_visual_scenes>'
    b'<scene><instance_visual_scene url="#s"/></scene>'
)


@pytest.mark.parametrize(
    ("name", "content"),
    [("a.3mf", EMPTY_3MF), ("a.dae", COLLADA % b""), ("a.dae", COLLADA % EMPTY_SCENE)],
)
def test_a_file_without_a_mesh_is_refused(tmp_path, name, content):
    path = tmp_path / name
    if name == "a.3mf":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("3D/3dmodel.model", content)
    else:
        path.write_bytes(content)
    with pytest.raises(UserError, match=r"\(it holds no mesh\); export it as \.glb"):
        read_mesh(path)


def test_error_names_a_file_of_the_wrong_kind(tmp_path):
    saved(tmp_path / "a.ply").rename(tmp_path / "a.off")
    with pytest.raises(UserError, match=r"ends in \.off but holds a \.ply file"):
        read_mesh(tmp_path / "a.off")


@pytest.mark.slow
def test_a_3mf_that_unpacks_to_gigabytes_is_refused(tmp_path):
    path = tmp_path / "a.3mf"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("3D/3dmodel.model", "w", force_zip64=True) as entry,
    ):
        for _ in range(5 * 1024):
            entry.write(bytes(1 << 20))
    with pytest.raises(UserError, match=r"a\.3mf"):
        read_mesh(path)
