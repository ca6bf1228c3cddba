"""Meshes compressed with Draco equal uncompressed ones; damaged streams are refused."""

from pathlib import Path

import DracoPy
import numpy as np
import pytest
import trimesh
from gltf_model import join_glb, split_glb

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.importing.add import ImportOptions, read_surface
from flyaround.simulator.targets.importing.read.draco import DRACO, decode_streams
from flyaround.simulator.targets.importing.read.mesh_file import read_mesh

BALL = trimesh.creation.icosphere(2, 1.0)
UV = (BALL.vertices[:, :2] * 0.5 + 0.5).astype(float)


def packed_glb(path, stream, *, count=None, plain=None, optional=False, nodes=1):
    """A GLB whose one mesh is a Draco stream, as exporters write it: accessors without data."""
    n, faces = len(BALL.vertices), 3 * len(BALL.faces)
    blob = stream + bytes(-len(stream) % 4) + (plain or b"")
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": [DRACO],
        "extensionsRequired": [] if optional else [DRACO],
        "scenes": [{"nodes": list(range(nodes))}],
        "nodes": [{"mesh": 0, "name": f"ball{k}", "translation": [3 * k, 0, 0]} for k in range(nodes)],
        "materials": [{"name": "skin"}],
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2},
                        "indices": 3,
                        "material": 0,
                        "extensions": {
                            DRACO: {"bufferView": 0, "attributes": ids_of(stream)},
                        },
                    }
                ]
            }
        ],
        "accessors": [
            {"componentType": 5126, "count": count or n, "type": "VEC3"},
            {"componentType": 5126, "count": n, "type": "VEC3"},
            {"componentType": 5126, "count": n, "type": "VEC2"},
            {"componentType": 5125, "count": faces, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": len(stream)}],
        "buffers": [{"byteLength": len(blob)}],
    }
    return join_glb(path, document, blob)


def ids_of(stream):
    """The stream's number of each attribute; of one that cannot be read the usual ones."""
    names = {0: "POSITION", 1: "NORMAL", 3: "TEXCOORD_0"}
    try:
        attributes = DracoPy.decode(stream).attributes
    except DracoPy.FileTypeException:
        return {"POSITION": 0}
    return {names[a["attribute_type"]]: a["unique_id"] for a in attributes}


@pytest.fixture(scope="module")
def stream():
    return DracoPy.encode(
        BALL.vertices.astype(np.float32),
        BALL.faces.astype(np.uint32),
        quantization_bits=16,
        normals=np.array(BALL.vertex_normals, float),
        tex_coord=UV,
    )


def test_packed_mesh_equals_the_unpacked_one(tmp_path, stream):
    model = read_mesh(packed_glb(tmp_path / "a.glb", stream, nodes=2))
    assert [p.name for p in model.parts] == ["ball0", "ball1"]
    part = model.parts[0]
    assert len(part.triangles) == len(BALL.faces)
    assert np.abs(np.linalg.norm(part.positions_m, axis=1) - 1).max() < 1e-3
    # a sphere's normals are its places
    assert np.einsum("ij,ij->i", part.normals, part.positions_m).min() > 0.99
    p = part.positions_m[part.triangles]
    volume = np.einsum("ij,ij->", p[:, 0], np.cross(p[:, 1], p[:, 2])) / 6
    assert volume == pytest.approx(BALL.volume, rel=1e-3)
    _, bodies, _, materials, _, lines = read_surface(tmp_path / "a.glb", ImportOptions())
    assert [m.name for m in materials] == ["skin"]
    assert sum(len(b.triangles) for b in bodies) == 2 * len(BALL.faces)
    assert not any("computed normals" in line for line in lines)


def test_texture_coordinates_are_packed_too(tmp_path, stream):
    path = packed_glb(tmp_path / "a.glb", stream)

    def textured(document):
        document["materials"][0]["pbrMetallicRoughness"] = {"baseColorTexture": {"index": 0}}
        document["textures"] = [{"source": 0}]
        document["images"] = [{"uri": "skin.png"}]

    import cv2

    cv2.imwrite(str(tmp_path / "skin.png"), np.zeros((4, 4, 3), np.uint8))
    rewritten(path, textured)
    (part,) = read_mesh(path).parts
    p = part.positions_m[part.triangles]
    assert np.abs(part.corner_uv - (p[..., :2] * 0.5 + 0.5)).max() < 2e-3


def rewritten(path, change):
    """The GLB with its JSON changed."""
    document, blob = split_glb(path)
    change(document)
    join_glb(path, document, blob)


def test_damaged_or_meshless_stream_is_refused(tmp_path, stream):
    cloud = DracoPy.encode(BALL.vertices.astype(np.float32))
    for bad in (stream[:100], b"DRACO" + bytes(50), cloud):
        with pytest.raises(
            UserError, match=r"a\.glb is packed with Draco and cannot be unpacked: .*; export it"
        ) as e:
            read_mesh(packed_glb(tmp_path / "a.glb", bad))
        assert "\n" not in str(e.value)

    def beyond(document):
        document["bufferViews"][0]["byteLength"] = 10**9

    def nowhere(document):
        document["meshes"][0]["primitives"][0]["extensions"][DRACO]["attributes"] = {"POSITION": 77}

    for change in (beyond, nowhere):
        path = packed_glb(tmp_path / "b.glb", stream)
        rewritten(path, change)
        with pytest.raises(UserError, match="breaks the rules of glTF 2"):
            read_mesh(path)


def test_oversized_stream_is_refused(stream):
    with pytest.raises(UserError, match="unpacks to more than is read"):
        decode_streams(Path("a.glb"), [stream], max_bytes=1000)
    assert decode_streams(Path("a.glb"), [stream])["faces_0"].shape == BALL.faces.shape
