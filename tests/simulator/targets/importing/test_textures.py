"""Textures of imported meshes keep their place, or their loss is reported."""

import re

import cv2
import numpy as np
import pytest
import trimesh
from gltf_model import join_glb, split_glb
from PIL import Image

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.glb.read import load_glb
from flyaround.simulator.targets.glb.write import write_glb
from flyaround.simulator.targets.importing.add import ImportOptions, import_mesh, read_surface
from flyaround.simulator.targets.importing.read.textures import decode_image

pytestmark = pytest.mark.usefixtures("coarse_proposals")

SIZE = 64
ROWS, COLUMNS = np.mgrid[0:SIZE, 0:SIZE] * (255.0 / (SIZE - 1))
PICTURE = np.stack([COLUMNS, ROWS, np.full((SIZE, SIZE), 90.0)], axis=-1).astype(np.uint8)
"""Red says how far right a place of the picture is, green how far down."""


def uv_of(points):
    """Texture coordinates by place, as modelling tools count them: v upwards from the picture's bottom."""
    return 0.1 + 0.8 * np.stack([points[:, 0] / 2 + 0.5, points[:, 1] + 0.5], axis=1)


def boxes(**maps):
    """A box of 2 x 1 x 0.5 m whose texture is projected along z."""
    mesh = trimesh.creation.box((2.0, 1.0, 0.5))
    mesh.unmerge_vertices()
    material = trimesh.visual.material.PBRMaterial(
        name="skin", roughnessFactor=0.5, metallicFactor=0.25, **maps
    )
    mesh.visual = trimesh.visual.TextureVisuals(uv=uv_of(mesh.vertices), material=material)
    return mesh


def colours_at_corners(target, y_up):
    """Colours that the texture has where each corner of the mesh is, and those that belong there."""
    seen, expected = [], []
    for part in target.parts:
        material = next(m for m in target.materials if m.name == part.material)
        image = decode_image(next(p.data for p in target.pictures if p.name == material.base_color_texture))
        at = np.rint(part.uv * SIZE - 0.5).astype(int)
        seen.append(image[at[:, 1], at[:, 0]])
        p = part.positions_m.astype(float)
        uv = uv_of(np.stack([p[:, 0], p[:, 2], -p[:, 1]], axis=1) if y_up else p)
        expected.append(np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1) * 255)
    return np.concatenate(seen)[:, :2].astype(float), np.concatenate(expected)


def test_textures_of_a_glb_stay_where_they_were(tmp_path):
    path = tmp_path / "box.glb"
    maps = {"baseColorTexture": Image.fromarray(PICTURE), "normalTexture": Image.fromarray(PICTURE)}
    path.write_bytes(boxes(**maps, metallicRoughnessTexture=Image.fromarray(PICTURE)).export(file_type="glb"))
    target, lines, _ = import_mesh(path, "box")
    seen, expected = colours_at_corners(target, y_up=True)
    assert np.abs(seen - expected).max() <= 4  # a picture element
    (material,) = target.materials
    assert all(material.textures)
    assert (material.roughness, material.metallic) == (0.5, 0.25)
    assert any("texture" in line and "took" in line for line in lines)
    # faces share corners where place, normal and texture agree: 4 to a side
    assert sum(len(p.positions_m) for p in target.parts) == 24
    write_glb(target, tmp_path / "again.glb")
    assert load_glb(tmp_path / "again.glb").sha256 == target.sha256


@pytest.mark.parametrize("ending", ["png", "bmp"])
def test_textures_of_an_obj_stay_where_they_were(tmp_path, ending):
    mesh = boxes()
    Image.fromarray(PICTURE).save(tmp_path / f"skin map.{ending}")
    (tmp_path / "a.mtl").write_text(f"newmtl skin\nKd 1 1 1\nmap_Kd skin map.{ending}\nmap_bump dents.png\n")
    rows = ["mtllib a.mtl", "usemtl skin"]
    rows += [f"v {x} {y} {z}" for x, y, z in mesh.vertices]
    rows += [f"vt {u} {v}" for u, v in mesh.visual.uv]
    # every second face the wrong way round: turned outwards, it keeps its texture
    faces = [f if k % 2 else f[::-1] for k, f in enumerate(mesh.faces + 1)]
    rows += [f"f {a}/{a} {b}/{b} {c}/{c}" for a, b, c in faces]
    (tmp_path / "a.obj").write_text("\n".join(rows))
    target, lines, _ = import_mesh(tmp_path / "a.obj", "a", ImportOptions())
    seen, expected = colours_at_corners(target, y_up=False)
    assert np.abs(seen - expected).max() <= 4
    assert any("turned 6 faces" in line for line in lines)
    assert "not carried over: maps map_bump" in lines


def test_faces_without_coordinates_get_the_mean_colour(tmp_path):
    image = np.full((8, 8, 3), 188, np.uint8)  # half of all light
    assert cv2.imwrite(str(tmp_path / "skin.png"), image)
    (tmp_path / "a.mtl").write_text("newmtl skin\nKd 0.8 0.6 0.4\nmap_Kd skin.png\n")
    mesh = trimesh.creation.box((2.0, 1.0, 0.5))
    rows = ["mtllib a.mtl", "usemtl skin", *(f"v {x} {y} {z}" for x, y, z in mesh.vertices)]
    rows += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    (tmp_path / "a.obj").write_text("\n".join(rows))
    target, lines, _ = import_mesh(tmp_path / "a.obj", "a")
    (material,) = target.materials
    assert (material.name, material.textures, target.pictures) == ("skin-plain", ("", "", ""), ())
    assert material.base_color == pytest.approx((0.4, 0.3, 0.2), abs=0.01)
    assert any("12 faces of material 'skin' have no texture coordinates" in line for line in lines)


def test_reduced_meshes_carry_colours_instead(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=4)
    half = np.zeros((8, 8, 3), np.uint8)
    half[:, :4], half[:, 4:] = (255, 0, 0), (0, 0, 255)
    uv = np.stack([ball.vertices[:, 0] * 0.49 + 0.5, np.full(len(ball.vertices), 0.5)], axis=1)
    material = trimesh.visual.material.PBRMaterial(name="skin", baseColorTexture=Image.fromarray(half))
    ball.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    (tmp_path / "ball.glb").write_bytes(ball.export(file_type="glb"))
    target, lines, _ = import_mesh(tmp_path / "ball.glb", "ball", ImportOptions(decimate=1000))
    assert target.pictures == ()
    assert all(p.uv is None for p in target.parts)
    assert {tuple(np.round(m.base_color)) for m in target.materials} >= {(1, 0, 0), (0, 0, 1)}
    for part in target.parts:
        red, _, blue = next(m.base_color for m in target.materials if m.name == part.material)
        x = part.positions_m[part.triangles].mean(axis=1)[:, 0]
        assert ((x < 0.1) if red > blue else (x > -0.1)).all()
    assert any("plain colours; detail finer than a face is lost" in line for line in lines)


def test_texture_transform_moves_scales_and_turns(tmp_path):
    path = tmp_path / "box.glb"
    path.write_bytes(boxes(baseColorTexture=Image.fromarray(PICTURE)).export(file_type="glb"))
    *_, plain, _ = read_surface(path, ImportOptions())
    document, blob = split_glb(path)
    change = {"offset": [0.1, 0.2], "scale": [0.5, 0.25], "rotation": np.pi / 2}
    texture = document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
    texture["extensions"] = {"KHR_texture_transform": change}
    join_glb(path, document, blob)
    *_, turned, _ = read_surface(path, ImportOptions())
    for a, b in zip(plain, turned, strict=True):
        u, v = a.uv.T
        # a quarter turn takes u to -v and v to u, v running down (KHR_texture_transform, Texture Transform Test)
        assert np.allclose(
            np.sort(b.uv, axis=0), np.sort(np.stack([0.1 + 0.25 * v, 0.2 - 0.5 * u], 1), axis=0), atol=1e-6
        )


def test_large_pictures_are_reduced_and_damaged_ones_named(tmp_path):
    path = tmp_path / "box.glb"
    wide = Image.fromarray(np.tile(PICTURE[:16], (1, 80, 1)))
    path.write_bytes(boxes(baseColorTexture=wide).export(file_type="glb"))
    target, lines, _ = import_mesh(path, "box")
    assert decode_image(target.pictures[0].data).shape[1] == 4096
    assert any("reduced from 5120 x 16 to 4096 x" in line for line in lines)
    data = bytearray(path.read_bytes())
    at = data.index(b"\x89PNG")
    data[at + 1 : at + 4] = b"XXX"
    path.write_bytes(data)
    says = r"texture .* is not a picture that can be read; convert it to PNG"
    target, lines, _ = import_mesh(path, "box")
    assert target.pictures == ()
    assert sum(re.search(says, line) is not None for line in lines) == 1
    with pytest.raises(UserError, match=says):
        import_mesh(path, "box", ImportOptions(strict=True))
