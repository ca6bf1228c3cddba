"""Mesh files from users: supported content, and one-sentence errors for the rest."""

import json
import re
import struct

import numpy as np
import pytest
import trimesh
from gltf_model import Gltf

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.importing.add import ImportOptions, read_surface
from flyaround.simulator.targets.importing.read.mesh_file import read_mesh
from flyaround.simulator.targets.importing.read.raw_model import UNNAMED_SURFACE
from flyaround.simulator.targets.importing.repair.placement import check_count, check_numbers, place_model

CUBE = trimesh.creation.box((2.0, 1.0, 0.5))


def write_gltf(path, mesh, *, change=None, **primitive):
    """A .gltf with its buffer inside; ``change(document)`` may spoil it."""
    gltf = Gltf(mesh.vertices, mesh.faces)
    gltf.primitive.update(primitive)
    document = gltf.whole()
    if change is not None:
        change(document)
    path.write_text(json.dumps(document))
    return path


def refusal(path):
    with pytest.raises(UserError) as caught:
        check_numbers(read_mesh(path))
    text = str(caught.value)
    assert "\n" not in text
    assert path.name in text
    return text


@pytest.mark.parametrize("kind", ["glb", "gltf", "obj", "stl", "stl_ascii"])
def test_a_box_is_read_from_every_kind(tmp_path, kind):
    path = tmp_path / f"box.{kind[:4].rstrip('_')}" if kind != "stl_ascii" else tmp_path / "box.stl"
    if kind == "gltf":
        write_gltf(path, CUBE)
    else:
        data = CUBE.export(file_type=kind)
        path.write_bytes(data.encode() if isinstance(data, str) else data)
    model = read_mesh(path)
    points = np.concatenate([p.positions_m[p.triangles].reshape(-1, 3) for p in model.parts])
    assert model.triangle_count == 12
    assert np.allclose(points.max(axis=0), (1.0, 0.5, 0.25))
    assert model.in_metres == (kind in ("glb", "gltf"))


def test_nodes_place_their_meshes_and_mirrors_turn_the_winding(tmp_path):
    def place(document):
        document["nodes"] = [
            {
                "name": "root",
                "children": [1],
                "translation": [10, 0, 0],
                "rotation": [0, 0, 0.5**0.5, 0.5**0.5],
            },
            {"name": "hull", "mesh": 0, "scale": [-1, 2, 1]},
        ]

    (part,) = read_mesh(write_gltf(tmp_path / "a.gltf", CUBE, change=place)).parts
    assert np.allclose(np.sort(part.positions_m.max(axis=0) - part.positions_m.min(axis=0)), (0.5, 2, 2))
    assert np.allclose(part.positions_m.mean(axis=0), (10, 0, 0))
    p = part.positions_m[part.triangles] - (10, 0, 0)
    assert np.einsum("ij,ij->", p[:, 0], np.cross(p[:, 1], p[:, 2])) / 6 == pytest.approx(2.0)


def test_materials_of_gltf(tmp_path):
    def paint(document):
        document["materials"] = [
            {
                "name": "cell",
                "pbrMetallicRoughness": {
                    "baseColorFactor": [0.1, 0.2, 0.3, 1],
                    "metallicFactor": 0.25,
                    "roughnessFactor": 0.4,
                },
                "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0.9}},
                "occlusionTexture": {"index": 0},
            }
        ]

    model = read_mesh(write_gltf(tmp_path / "a.gltf", CUBE, change=paint, material=0))
    m = model.materials[0]
    assert (m.name, m.base_color) == ("cell", (0.1, 0.2, 0.3))
    assert (m.metallic, m.roughness, m.clearcoat) == (0.25, 0.4, 0.9)
    assert any("occlusion maps" in note for note in model.notes)


def test_edges_written_as_faces_are_left_out(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\nf 1 2 3\n")
    model = read_mesh(tmp_path / "a.obj")
    assert model.triangle_count == 1
    assert "left out 1 faces of fewer than three corners" in model.notes


def test_objects_groups_and_relative_indices_of_obj(tmp_path):
    (tmp_path / "a.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\no wing\nf -4 -3 -2 -1\no body\nv 0 0 1\nf 1//  2// 5//\n"
    )
    model = read_mesh(tmp_path / "a.obj")
    assert [(p.name, len(p.triangles)) for p in model.parts] == [("wing", 2), ("body", 1)]


def test_a_file_that_is_not_what_its_ending_says(tmp_path):
    stl = CUBE.export(file_type="stl")
    (tmp_path / "a.glb").write_bytes(stl)
    assert "holds a .stl file; rename it to a.stl" in refusal(tmp_path / "a.glb")
    (tmp_path / "b.stl").write_bytes(CUBE.export(file_type="glb"))
    assert "holds a .glb file" in refusal(tmp_path / "b.stl")
    (tmp_path / "c.obj").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    assert "a PNG image" in refusal(tmp_path / "c.obj")
    for kind in ("glb", "obj", "stl"):
        (tmp_path / f"lfs.{kind}").write_bytes(
            b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n"
        )
        assert "Git LFS pointer" in refusal(tmp_path / f"lfs.{kind}")
    (tmp_path / "d.stl").write_bytes(b"")
    assert "is empty" in refusal(tmp_path / "d.stl")
    (tmp_path / "e.fbx").write_bytes(b"Kaydara")
    assert "export it as .glb" in refusal(tmp_path / "e.fbx")
    (tmp_path / "f.stl").write_bytes(CUBE.export(file_type="stl_ascii").encode()[:400])
    assert "cut short" in refusal(tmp_path / "f.stl")
    assert "cannot read" in refusal(tmp_path / "nowhere.obj")


def test_missing_files_are_named(tmp_path):
    def elsewhere(document):
        document["buffers"][0]["uri"] = "hull%20data.bin"

    assert "'hull data.bin' is missing" in refusal(write_gltf(tmp_path / "a.gltf", CUBE, change=elsewhere))
    body = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl skin\nf 1 2 3\n"
    (tmp_path / "b.obj").write_text("mtllib gone.mtl\n" + body)
    (tmp_path / "c.mtl").write_text("newmtl skin\nKd 1 0 0\nmap_Kd gone.png\n")
    (tmp_path / "c.obj").write_text("mtllib c.mtl\n" + body)
    (tmp_path / "d.mtl").write_text("newmtl other\n")
    (tmp_path / "d.obj").write_text("mtllib d.mtl\n" + body)
    for name, says in (
        ("b.obj", "material file 'gone.mtl' is missing"),
        ("c.obj", "texture 'gone.png' of material 'skin' is missing"),
        ("d.obj", "material 'skin' is in none"),
    ):
        model = read_mesh(tmp_path / name)
        assert [says in fault for fault in model.faults] == [True]
        drawn = model.materials[int(model.parts[0].face_material[0])]
        assert drawn.base_color == ((1, 0, 0) if name == "c.obj" else UNNAMED_SURFACE.base_color)
        with pytest.raises(UserError, match=re.escape(says)):
            read_surface(tmp_path / name, ImportOptions(strict=True))


def test_broken_gltf_is_refused(tmp_path):
    def circle(document):
        document["nodes"] = [{"children": [0], "mesh": 0}]

    def overrun(document):
        document["accessors"][0]["count"] = 4000

    def index(document):
        document["accessors"][0]["count"] = 5

    for change, says in (
        (circle, "breaks the rules of glTF 2.0"),
        (overrun, "runs past the end"),
        (
            index,
            "part 'hull': 8 triangles use vertices that are not there (the first, triangle 4, uses 7 of 5)",
        ),
        (lambda d: d.update(asset={"version": "1.0"}), "glTF version 1"),
        (lambda d: d.update(meshes="none"), "breaks the rules of glTF 2.0"),
    ):
        assert says in refusal(write_gltf(tmp_path / "a.gltf", CUBE, change=change))
    glb = CUBE.export(file_type="glb")
    (tmp_path / "b.glb").write_bytes(glb[: len(glb) // 2])
    assert "cut short" in refusal(tmp_path / "b.glb")


def test_vertices_that_are_not_finite_are_counted(tmp_path):
    bad = CUBE.copy()
    vertices = bad.vertices.copy()
    vertices[3:5] = np.nan
    path = tmp_path / "a.gltf"
    write_gltf(path, trimesh.Trimesh(vertices, bad.faces, process=False, validate=False))
    text = refusal(path)
    assert "part 'hull': 2 of 8 vertices are not finite (the first is vertex 3)" in text


def test_obj_that_is_malformed(tmp_path):
    for text, says in (
        ("v 0 0 zero\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "has a value that is not a number"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "uses vertex 9 of 3"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "holds no triangles"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2\n", "holds no triangles"),
    ):
        (tmp_path / "a.obj").write_text(text)
        assert says in refusal(tmp_path / "a.obj")


@pytest.mark.parametrize(
    ("factor", "says"),
    [
        (740.0, "--units mm if it is in millimetres (0.74 m)"),
        (1471.0, "--units mm if it is in millimetres (1.47 m)"),
        (400_000.0, "--scale with the factor"),
        (0.04, "--yes if it is that size"),
        (1e-4, "--scale 1e+04 makes it 1 m"),
    ],
)
def test_a_size_that_no_spacecraft_has(tmp_path, factor, says):
    path = tmp_path / "a.stl"
    path.write_bytes(trimesh.creation.box((factor, factor / 2, factor / 3)).export(file_type="stl"))
    with pytest.raises(UserError, match="not the size of a spacecraft") as caught:
        place_model(read_mesh(path), None, None, None)
    assert any(s in str(caught.value) for s in says.split("|"))


def test_units_and_up_axis_options(tmp_path):
    path = tmp_path / "a.stl"
    path.write_bytes(trimesh.creation.box((740.0, 300.0, 100.0)).export(file_type="stl"))
    model = read_mesh(path)
    lines = place_model(model, None, "mm", "y")
    p = model.parts[0].positions_m
    assert np.allclose(p.max(axis=0) - p.min(axis=0), (0.74, 0.1, 0.3))
    assert "0.74 x 0.1 x 0.3 m" in lines[0]
    for arguments, says in (
        ((0.5, "mm", None), "not both"),
        ((None, "feet", None), "unknown unit 'feet'"),
        ((-1.0, None, None), "not a positive number"),
        ((None, None, "x"), "unknown axis 'x'"),
        ((1e4, None, None), "not the size of a spacecraft"),
        ((None, "m", None), "--units mm if it is in millimetres"),
    ):
        with pytest.raises(UserError, match=says):
            place_model(read_mesh(path), *arguments)


def test_too_many_triangles_are_refused(tmp_path):
    path = tmp_path / "a.stl"
    count = 600_000
    path.write_bytes(bytes(80) + struct.pack("<I", count) + bytes(50 * count))
    with pytest.raises(UserError, match=r"600,000 triangles .* --decimate 200000"):
        check_count(read_mesh(path), None)
    with pytest.raises(UserError, match="--decimate 3 is out of range"):
        check_count(read_mesh(path), 3)


def test_an_origin_far_from_the_craft_is_said_and_moved_when_told(tmp_path):
    """7 m across, its middle 12 m from the origin: poses of that origin would put the craft out of view."""
    box = trimesh.creation.box((7.0, 2.0, 2.0))
    near, far = box.copy(), box.copy()
    near.apply_translation((3.5, 0.0, 1.0))  # an origin in a corner is a launcher's, and usual
    far.apply_translation((0.0, 12.0, 0.0))
    (tmp_path / "near.stl").write_bytes(near.export(file_type="stl"))
    (tmp_path / "far.stl").write_bytes(far.export(file_type="stl"))
    assert len(place_model(read_mesh(tmp_path / "near.stl"), None, None, None)) == 1
    (_, warning) = place_model(read_mesh(tmp_path / "far.stl"), None, None, None)
    assert "origin is 12 m from the middle of a craft 7 m across" in warning
    assert "add --recentre" in warning
    model = read_mesh(tmp_path / "far.stl")
    (_, said) = place_model(model, None, None, None, recentre=True)
    assert said == "moved the origin by (0, 12, 0) m, to the middle of the box about the model"
    p = model.parts[0].positions_m
    assert np.allclose(p.max(axis=0), (3.5, 1.0, 1.0))
    assert np.allclose(p.min(axis=0), (-3.5, -1.0, -1.0))
