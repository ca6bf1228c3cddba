"""Target files: bit-exact round trip, independent readers, refusals, the board's file."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jsonschema
import msgspec
import numpy as np
import pygltflib
import pytest
import trimesh
from gltf_model import join_glb, split_glb

from flyaround.hil.board_model.records import BoardModelRecord
from flyaround.hil.board_model.write import write_board_model
from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.check_target import check_mass, check_part
from flyaround.simulator.targets.glb.read import load_glb, parse_json
from flyaround.simulator.targets.glb.write import write_glb
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.targets.model import MassProperties, Part
from flyaround.simulator.targets.records import TargetRecord


@pytest.fixture(scope="module")
def tango():
    return load_target("tango")


@pytest.fixture(scope="module")
def glb(tango, tmp_path_factory):
    path = tmp_path_factory.mktemp("targets") / "tango.glb"
    write_glb(tango, path)
    return path


def test_round_trip_is_bit_exact(tmp_path):
    for target in map(load_target, ("tango", "tango-mli", "tianzhou")):
        path = tmp_path / f"{target.name}.glb"
        write_glb(target, path)
        again = load_glb(path)
        for name in ("name", "title", "sha256", "materials", "keypoints", "wireframe", "mass", "frames"):
            assert getattr(again, name) == getattr(target, name), name
        assert again.symmetry == target.symmetry
        assert again.notes == target.notes
        assert np.array_equal(again.occluders.vertices_m, target.occluders.vertices_m)
        assert np.array_equal(again.occluders.triangles, target.occluders.triangles)
        for a, b in zip(again.parts, target.parts, strict=True):
            assert (a.name, a.material) == (b.name, b.material)
            for field in ("positions_m", "normals", "triangles"):
                x, y = getattr(a, field), getattr(b, field)
                assert x.dtype == y.dtype
                assert x.tobytes() == y.tobytes()


def test_writing_twice_gives_the_same_bytes(tango, glb, tmp_path):
    write_glb(tango, tmp_path / "again.glb")
    assert (tmp_path / "again.glb").read_bytes() == glb.read_bytes()
    assert [p.name for p in tmp_path.iterdir()] == ["again.glb"]


def test_trimesh_sees_the_same_bounds_and_parts(tango, glb):
    scene = trimesh.load_scene(glb)
    everything = np.concatenate([p.positions_m for p in tango.parts])
    lo, hi = everything.min(axis=0), everything.max(axis=0)
    # viewers take y up: (x, y, z) of the file is (x, z, -y) of the target
    assert np.allclose(scene.bounds, [(lo[0], lo[2], -hi[1]), (hi[0], hi[2], -lo[1])], atol=1e-6)
    assert set(scene.geometry) == {p.name for p in tango.parts}
    for part in tango.parts:
        geometry = scene.geometry[part.name]
        assert len(geometry.faces) == len(part.triangles)
        material = next(m for m in tango.materials if m.name == part.material)
        assert geometry.visual.material.name == material.name
        assert geometry.visual.material.roughnessFactor == pytest.approx(material.roughness)


def test_pygltflib_sees_materials_and_extras(tango, glb):
    document = pygltflib.GLTF2().load(str(glb))
    by_name = {m.name: m for m in document.materials}
    for m in tango.materials:
        pbr = by_name[m.name].pbrMetallicRoughness
        assert tuple(pbr.baseColorFactor[:3]) == m.base_color
        assert (pbr.metallicFactor, pbr.roughnessFactor) == (m.metallic, m.roughness)
    coat = by_name["solar-cell"].extensions["KHR_materials_clearcoat"]
    assert coat["clearcoatFactor"] == 1.0
    assert document.extensionsUsed == ["KHR_materials_clearcoat"]
    extras = document.scenes[0].extras["flyaround"]
    assert extras["schema"] == "flyaround.target"
    schema = msgspec.json.schema(TargetRecord)
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.Draft202012Validator(schema).validate(extras)


def test_textures_go_out_and_come_back(tmp_path):
    board = load_target("calibration-board")
    path = tmp_path / "board.glb"
    write_glb(board, path)
    again = load_glb(path)
    assert (again.materials, again.pictures) == (board.materials, board.pictures)
    for a, b in zip(again.parts, board.parts, strict=True):
        assert (a.uv is None) == (b.uv is None)
        assert a.uv is None or (b.uv is not None and a.uv.tobytes() == b.uv.tobytes())
    document = pygltflib.GLTF2().load(str(path))
    printed = next(m for m in document.materials if m.name == "board-markers")
    texture = document.textures[printed.pbrMetallicRoughness.baseColorTexture.index]
    assert document.images[texture.source].mimeType == "image/png"
    material = trimesh.load_scene(path).geometry["squares_light"].visual.material
    assert material.baseColorTexture.size == (2112, 1536)
    # trimesh turns v over; the upper left square holds no marker, its right neighbour one
    uv = trimesh.load_scene(path).geometry["squares_light"].visual.uv
    assert uv.min() >= 0
    assert uv.max() <= 1
    paper, ink = (np.asarray(material.baseColorTexture.convert("L"))[24, x] for x in (24, 8 * 24 + 36))
    assert (paper, ink) == (255, 54)


def no_coordinates(document):
    mesh = next(m for m in document["meshes"] if m["name"] == "squares_light")
    del mesh["primitives"][0]["attributes"]["TEXCOORD_0"]


def other_picture(document):
    view = document["bufferViews"][document["images"][0]["bufferView"]]
    view["byteOffset"] += 4
    view["byteLength"] -= 4


def shorter_picture(document):
    document["bufferViews"][document["images"][0]["bufferView"]]["byteLength"] -= 4


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (
            no_coordinates,
            "part 'squares_light': its material has a texture and the part no texture coordinates",
        ),
        (other_picture, "texture 'markers' is neither PNG nor JPEG; convert it"),
        (shorter_picture, "does not match its own hash"),
    ],
)
def test_damaged_textures_are_refused(damage, message, tmp_path):
    path = tmp_path / "board.glb"
    write_glb(load_target("calibration-board"), path)
    document, blob = split_glb(path)
    damage(document)
    with pytest.raises(UserError, match=message):
        load_glb(join_glb(path, document, blob))


def test_a_keypoint_off_the_mesh_is_named(tango, tmp_path):
    first, *others = tango.keypoints
    x, y, z = first.position_m
    millimetres = replace(first, position_m=(1000 * x, 1000 * y, 1000 * z))
    write_glb(replace(tango, keypoints=(millimetres, *others)), tmp_path / "off.glb")
    with pytest.raises(
        UserError, match=rf"keypoint {first.name!r} at .* is off the mesh by more than 0\.022\d? m; put"
    ):
        load_glb(tmp_path / "off.glb")


def test_hash_depends_on_what_is_seen_and_not_on_notes(tango, tmp_path):
    write_glb(replace(tango, notes="another note"), tmp_path / "noted.glb")
    assert load_glb(tmp_path / "noted.glb").sha256 == tango.sha256
    white, *others = tango.materials
    write_glb(replace(tango, materials=(replace(white, roughness=0.61), *others)), tmp_path / "rough.glb")
    with pytest.raises(UserError, match="does not match its own hash"):
        load_glb(tmp_path / "rough.glb")


def overwrite(document, blob, part, field, data, at=0):
    """The binary chunk with bytes of one accessor replaced."""
    mesh = next(m for m in document["meshes"] if m["name"] == part)["primitives"][0]
    number = mesh["indices"] if field == "indices" else mesh["attributes"][field]
    start = document["bufferViews"][document["accessors"][number]["bufferView"]].get("byteOffset", 0) + at
    return blob[:start] + data + blob[start + len(data) :]


def moved_keypoint(document, blob):
    document["scenes"][0]["extras"]["flyaround"]["keypoints"][0]["position_m"][0] += 1e-9
    return blob


def nan_vertex(document, blob):
    return overwrite(document, blob, "bar", "POSITION", struct.pack("<f", float("nan")), 24)


def moved_vertex(document, blob):
    return overwrite(document, blob, "plate_white", "POSITION", struct.pack("<f", 0.1931))


def no_normals(document, blob):
    for mesh in document["meshes"]:
        del mesh["primitives"][0]["attributes"]["NORMAL"]
    return blob


def zero_normals(document, blob):
    return overwrite(document, blob, "rod", "NORMAL", bytes(12))


def inverted_face(document, blob):
    return overwrite(document, blob, "plate_white", "indices", struct.pack("<3I", 2, 1, 0))


def degenerate_face(document, blob):
    return overwrite(document, blob, "plate_white", "indices", struct.pack("<3I", 0, 0, 1))


def index_out_of_range(document, blob):
    return overwrite(document, blob, "plate_white", "indices", struct.pack("<3I", 0, 1, 4_000_000))


def no_extras(document, blob):
    del document["scenes"][0]["extras"]
    return blob


def another_version(document, blob):
    document["scenes"][0]["extras"]["flyaround"]["version"] = 9
    return blob


def heavy_on_one_axis(document, blob):
    document["scenes"][0]["extras"]["flyaround"]["mass"]["inertia_kg_m2"][2][2] = 99.0
    return blob


def twin_keypoints(document, blob):
    points = document["scenes"][0]["extras"]["flyaround"]["keypoints"]
    points[1]["name"] = points[0]["name"]
    return blob


def nan_keypoint(document, blob):
    document["scenes"][0]["extras"]["flyaround"]["keypoints"][0]["position_m"][0] = float("nan")
    return blob


def frame_without_axis(document, blob):
    frame = {"origin_m": [0.0, 0.0, 0.0], "axis": [0.0, 0.0, 0.0]}
    document["scenes"][0]["extras"]["flyaround"]["frames"] = {"docking": frame}
    return blob


def symmetry_of_length_2(document, blob):
    document["scenes"][0]["extras"]["flyaround"]["symmetry_wxyz"] = [[2.0, 0.0, 0.0, 0.0]]
    return blob


def edge_without_normal(document, blob):
    document["scenes"][0]["extras"]["flyaround"]["wireframe"][0]["normals"] = [[0.0, 0.0, 0.0]]
    return blob


def twin_materials(document, blob):
    document["materials"][1]["name"] = document["materials"][0]["name"]
    return blob


def twin_parts(document, blob):
    first, second, *_ = (node for node in document["nodes"] if "mesh" in node)
    second["name"] = first["name"]
    return blob


def rougher_than_rough(document, blob):
    document["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = 7.0
    return blob


def brighter_than_white(document, blob):
    document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = [5.0, 5.0, 5.0, 1.0]
    return blob


def missing_accessor(document, blob):
    document["accessors"] = document["accessors"][:3]
    return blob


def short_binary(_document, blob):
    return blob[: len(blob) // 2]


DAMAGE: dict[Callable[[dict[str, Any], bytes], bytes], str] = {
    moved_keypoint: "does not match its own hash",
    moved_vertex: "does not match its own hash",
    nan_vertex: "part 'bar': vertex 2 is not finite",
    no_normals: "no normals",
    zero_normals: "part 'rod': normals are not unit vectors",
    inverted_face: "part 'plate_white': some triangles are wound against their normals",
    degenerate_face: "part 'plate_white': triangle 0 has no area",
    index_out_of_range: "part 'plate_white': a triangle uses vertex 4000000",
    no_extras: "has no `flyaround` extras",
    another_version: r"version",
    heavy_on_one_axis: "no rigid body has principal moments",
    twin_keypoints: "two keypoints are called 'panel_nx_ny'",
    nan_keypoint: "no readable JSON",
    frame_without_axis: "frame 'docking': its axis is not a unit vector",
    symmetry_of_length_2: "a symmetry is not a unit quaternion",
    edge_without_normal: "edge '.*': its normals are not unit vectors",
    twin_materials: "two materials are called",
    twin_parts: "two parts are called",
    rougher_than_rough: "material '.*': roughness is 7, allowed: 0 to 1",
    brighter_than_white: "material '.*': base_color is 5, allowed: 0 to 1",
    missing_accessor: "breaks the rules of glTF 2.0",
    short_binary: "breaks the rules of glTF 2.0",
}


@pytest.mark.parametrize("damage", DAMAGE, ids=lambda d: d.__name__)
def test_damaged_file_is_refused_in_one_sentence(damage, glb, tmp_path):
    document, blob = split_glb(glb)
    blob = damage(document, blob)
    path = join_glb(tmp_path / "bad.glb", document, blob)
    with pytest.raises(UserError, match=DAMAGE[damage]) as caught:
        load_glb(path)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message


def test_a_vertex_of_a_negative_index_is_named(tango):
    part = tango.parts[0]
    triangles = part.triangles.astype(np.int64)
    triangles[1, 2] = -7
    with pytest.raises(UserError, match=f"uses vertex -7 of {len(part.positions_m)};"):
        check_part(replace(part, triangles=triangles), "here")


def test_an_inertia_that_is_not_finite_is_not_called_asymmetric(tango):
    inertia = np.array(tango.mass.inertia_kg_m2, float)
    inertia[1, 1] = np.nan
    with pytest.raises(UserError, match="inertia is not finite"):
        check_mass(replace(tango.mass, inertia_kg_m2=inertia), "here")


def test_a_number_too_large_is_refused():
    with pytest.raises(ValueError, match="1e999 is too large"):
        parse_json(b'{"axis": [1e999, -3e-999, 1e308]}')


def test_rounding_does_not_make_an_inertia_asymmetric(tango):
    inertia = np.diag([1.0, 1.0, 1.0])
    inertia[0, 1], inertia[1, 0] = 1e-17, -1e-17
    check_mass(replace(tango.mass, inertia_kg_m2=inertia), "here")
    inertia[0, 1] = 1e-6
    with pytest.raises(UserError, match="here: the inertia must be a symmetric 3x3 matrix"):
        check_mass(replace(tango.mass, inertia_kg_m2=inertia), "here")


def test_an_inertia_of_two_axes_is_refused(tango):
    with pytest.raises(UserError, match="3x3"):
        check_mass(replace(tango.mass, inertia_kg_m2=np.eye(2)), "here")


@pytest.mark.parametrize(("side_m", "is_refused"), [(0.9e-7, True), (1.1e-7, False)])
def test_smallest_area_is_half_a_square_of_a_tenth_of_a_micrometre(side_m, is_refused):
    corners = np.array([[0, 0, 0], [side_m, 0, 0], [0, side_m, 0]])
    part = Part(
        name="corner",
        material="grey",
        positions_m=corners,
        normals=np.tile([0, 0, 1.0], (3, 1)),
        triangles=np.array([[0, 1, 2]]),
    )
    if is_refused:
        with pytest.raises(UserError, match="triangle 0 has no area"):
            check_part(part, "here")
    else:
        check_part(part, "here")


@pytest.mark.parametrize("keep", [3, 11, 16, 500, 200_000])
def test_truncated_file_is_refused(keep, glb, tmp_path):
    path = tmp_path / "short.glb"
    path.write_bytes(glb.read_bytes()[:keep])
    with pytest.raises(UserError, match=r"cut short|not a binary glTF"):
        load_glb(path)


def test_other_files_are_refused(tmp_path):
    stl = tmp_path / "part.glb"
    stl.write_bytes(b"solid part\nendsolid part\n")
    with pytest.raises(UserError, match="not a binary glTF file"):
        load_target(stl)
    with pytest.raises(UserError, match=r"cannot read target .*nowhere\.glb"):
        load_target(tmp_path / "nowhere.glb")
    plain = tmp_path / "plain.glb"
    plain.write_bytes(trimesh.creation.box().export(file_type="glb"))
    with pytest.raises(UserError, match="plain glTF model"):
        load_glb(plain)


def test_impossible_mass_is_refused_at_writing_time_of_a_reader(tango, tmp_path):
    mass = MassProperties(mass_kg=-1.0, com_m=(0, 0, 0), inertia_kg_m2=tango.mass.inertia_kg_m2)
    write_glb(replace(tango, mass=mass), tmp_path / "light.glb")
    with pytest.raises(UserError, match="mass_kg"):
        load_glb(tmp_path / "light.glb")


def test_unwritable_folder_is_one_sentence(tango, tmp_path):
    with pytest.raises(UserError, match="cannot write"):
        write_glb(tango, tmp_path / "missing" / "tango.glb")


def test_board_file_validates_and_holds_the_labels(tango, tmp_path):
    path = tmp_path / "tango.board.json"
    write_board_model(tango, path)
    board = json.loads(path.read_text())
    schema = msgspec.json.schema(BoardModelRecord)
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.Draft202012Validator(schema).validate(board)
    assert (board["schema"], board["version"]) == ("flyaround.board_model", 1)
    assert board["sha256"] == tango.sha256
    assert [tuple(k["position_m"]) for k in board["keypoints"]] == [k.position_m for k in tango.keypoints]
    assert {e["name"]: tuple(e["a_m"]) for e in board["wireframe"]} == {
        e.name: e.a_m for e in tango.wireframe
    }
    assert np.array_equal(board["occluders"]["vertices_m"], tango.occluders.vertices_m)
    assert board["mass_kg"] == tango.mass.mass_kg
    assert path.stat().st_size < 180_000
    broken = {**board, "version": 2}
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft202012Validator(schema).validate(broken)
