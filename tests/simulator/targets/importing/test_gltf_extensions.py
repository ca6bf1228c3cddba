"""glTF extensions: supported, harmless, reported or refused."""

from pathlib import Path

import cv2
import DracoPy
import numpy as np
import pytest
from gltf_model import Gltf

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.importing.read.mesh_file import read_mesh

REPORTS = Path(__file__).parents[3] / "data" / "reports"
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "<f4")
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


class Tetrahedron(Gltf):
    """A tetrahedron of one material, to be changed before it is read."""

    def __init__(self, folder):
        super().__init__(CORNERS, FACES)
        self.folder = folder
        self.paint(name="skin")

    def texture(self, name="skin.png", **record):
        self.document.setdefault("images", []).append({"uri": name})
        self.document.setdefault("textures", []).append(
            {"source": len(self.document["images"]) - 1, **record}
        )
        return {"index": len(self.document["textures"]) - 1}

    def read(self):
        return read_mesh(self.write(self.folder / "a.gltf"))


@pytest.fixture
def gltf(tmp_path):
    cv2.imwrite(str(tmp_path / "skin.png"), np.full((4, 4, 3), 128, np.uint8))
    return Tetrahedron(tmp_path)


def places(model):
    return [p.positions_m.min(axis=0).round(6).tolist() for p in model.parts]


def test_reported_instances_are_placed():
    model = read_mesh(REPORTS / "gltf_instancing_visibility" / "instancing.gltf")
    assert places(model) == [[0, 0, 0], [5, 0, 0], [10, 0, 0]]


def test_instances_turn_and_scale_within_their_node(gltf):
    half = np.array([[0, 0, 0, 32767], [0, 0, 23170, 23170]], "<i2")
    gltf.document["nodes"][0] |= {
        "translation": [0, 0, 7],
        "extensions": {
            "EXT_mesh_gpu_instancing": {
                "attributes": {
                    "TRANSLATION": gltf.accessor(np.array([[0, 0, 0], [3, 0, 0]], "<f4")),
                    "ROTATION": gltf.accessor(half, normalized=True),
                    "SCALE": gltf.accessor(np.array([[1, 1, 1], [2, 2, 2]], "<f4")),
                    "_COLOR": 0,
                }
            }
        },
    }
    first, second = gltf.read().parts
    assert np.ptp(first.positions_m, axis=0) == pytest.approx([1, 1, 1])
    assert second.positions_m.min(axis=0) == pytest.approx([1, 0, 7], abs=1e-3)
    assert second.positions_m.max(axis=0) == pytest.approx([3, 2, 9], abs=1e-3)


def test_instances_of_unequal_counts_are_refused(gltf):
    gltf.document["nodes"][0]["extensions"] = {
        "EXT_mesh_gpu_instancing": {
            "attributes": {
                "TRANSLATION": gltf.accessor(np.zeros((2, 3), "<f4")),
                "SCALE": gltf.accessor(np.ones((3, 3), "<f4")),
            }
        }
    }
    with pytest.raises(UserError, match="instances have 2 and 3 places"):
        gltf.read()


def test_hidden_nodes_are_left_out_with_all_below_them(gltf):
    hidden = {"KHR_node_visibility": {"visible": False}}
    gltf.document["nodes"] = [
        {"mesh": 0, "name": "shown", "children": [1]},
        {"name": "off", "children": [2], "extensions": hidden},
        {"mesh": 0, "name": "below", "extensions": {"KHR_node_visibility": {"visible": True}}},
    ]
    model = gltf.read()
    assert [p.name for p in model.parts] == ["shown"]
    assert model.notes == ["left out 1 nodes that KHR_node_visibility hides, with all below them"]


@pytest.mark.parametrize(
    "name",
    [
        "KHR_materials_transmission",
        "KHR_materials_unlit",
        "KHR_materials_sheen",
        "KHR_materials_volume",
        "KHR_materials_iridescence",
        "KHR_materials_specular",
        "KHR_materials_ior",
        "KHR_materials_dispersion",
        "KHR_materials_diffuse_transmission",
        "KHR_materials_variants",
        "KHR_lights_punctual",
        "EXT_lights_image_based",
        "ACME_something_new",
    ],
)
@pytest.mark.parametrize("listed", [True, False])
def test_extensions_that_change_the_image_are_reported(gltf, name, listed):
    if listed:
        gltf.document["extensionsUsed"] = [name]
    else:
        gltf.document["materials"][0]["extensions"] = {name: {}}
    assert [name in note for note in gltf.read().notes] == [True]


def test_transmission_is_reported():
    model = read_mesh(REPORTS / "gltf_transmission_unlit" / "transmission.gltf")
    assert ["KHR_materials_transmission" in note for note in model.notes] == [True]


@pytest.mark.parametrize(
    "name",
    [
        "KHR_mesh_quantization",
        "KHR_texture_transform",
        "KHR_xmp_json_ld",
        "EXT_mesh_features",
        "EXT_texture_webp",
    ],
)
def test_supported_and_harmless_extensions_are_not_reported(gltf, name):
    gltf.document["extensionsUsed"] = [name]
    assert gltf.read().notes == []


@pytest.mark.parametrize(
    "name", ["ACME_something_new", "KHR_materials_unheard_of", "CESIUM_RTC", "KHR_texture_foo"]
)
def test_required_extensions_that_are_not_known_are_refused(gltf, name):
    gltf.document |= {"extensionsRequired": [name], "extensionsUsed": [name]}
    with pytest.raises(UserError, match=f"requires the glTF extension {name}"):
        gltf.read()


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
def test_meshopt_is_refused_with_the_way_out(gltf, name):
    gltf.document |= {"extensionsRequired": [name], "extensionsUsed": [name]}
    with pytest.raises(UserError, match=r"compressed with meshopt.*gltf-transform"):
        gltf.read()


def test_meshopt_beside_plain_data_is_read(gltf):
    gltf.document["extensionsUsed"] = ["EXT_meshopt_compression"]
    assert gltf.read().triangle_count == 4


def test_ignored_gltf_objects_are_reported(gltf):
    gltf.document |= {
        "animations": [{"channels": [], "samplers": []}],
        "cameras": [{"type": "perspective"}],
        "skins": [{"joints": [0]}],
    }
    gltf.document["nodes"][0]["skin"] = 0
    (note,) = gltf.read().notes
    for word in ("animations", "cameras", "skins"):
        assert word in note


def test_quantised_coordinates_inside_draco_keep_their_type(gltf):
    """Whole numbers come out of the decoder as floats; the accessor says that 32767 is 1."""
    whole = np.rint(CORNERS * 32767).astype(np.int16)
    stream = DracoPy.encode(whole, FACES.astype(np.uint32), preserve_order=True)
    gltf.document |= {
        "extensionsUsed": ["KHR_draco_mesh_compression", "KHR_mesh_quantization"],
        "extensionsRequired": ["KHR_draco_mesh_compression", "KHR_mesh_quantization"],
    }
    for accessor in gltf.document["accessors"]:
        del accessor["bufferView"]
    gltf.document["accessors"][0] |= {"componentType": 5122, "normalized": True}
    gltf.primitive["extensions"] = {
        "KHR_draco_mesh_compression": {"bufferView": gltf.view(stream), "attributes": {"POSITION": 0}}
    }
    assert np.ptp(gltf.read().parts[0].positions_m, axis=0) == pytest.approx([1, 1, 1], abs=1e-3)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"\xabKTX 20\xbb\r\n\x1a\n" + bytes(60), "a KTX texture"),
        (b"DDS " + bytes(120), "a DDS texture"),
        (b"\0\0\0\x20ftypavif" + bytes(60), "an AVIF picture"),
        (b"<svg xmlns=''/>", "an SVG drawing"),
        (b"junk", "not a picture that can be read"),
    ],
)
def test_pictures_that_are_not_read_leave_the_factor(gltf, data, says):
    (gltf.folder / "other.ktx2").write_bytes(data)
    gltf.document["materials"][0]["pbrMetallicRoughness"] = {
        "baseColorFactor": [0.5, 0.25, 0.125, 1],
        "baseColorTexture": gltf.texture("other.ktx2"),
    }
    model = gltf.read()
    assert [says in fault for fault in model.faults] == [True]
    assert (model.materials[0].base_color, model.materials[0].base_color_texture) == ((0.5, 0.25, 0.125), "")


def test_pictures_that_are_read(gltf):
    cv2.imwrite(str(gltf.folder / "my skin.webp"), np.full((4, 4, 3), 128, np.uint8))
    gltf.document["materials"][0]["pbrMetallicRoughness"] = {"baseColorTexture": {"index": 0}}
    gltf.document["images"] = [{"uri": "my%20skin.webp"}]
    gltf.document["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0}}}]
    gltf.primitive["attributes"]["TEXCOORD_0"] = gltf.accessor(CORNERS[:, :2])
    model = gltf.read()
    assert model.faults == []
    assert len(model.pictures) == 1


def test_a_second_set_of_coordinates_and_clamped_edges(gltf):
    uv = np.array([[0, 0], [2, 0], [0, 2], [2, 2]], "<f4")
    gltf.document["samplers"] = [{"wrapS": 33071, "wrapT": 33071}]
    gltf.document["materials"][0]["pbrMetallicRoughness"] = {
        "baseColorTexture": {**gltf.texture(sampler=0), "texCoord": 1}
    }
    gltf.primitive["attributes"] |= {"TEXCOORD_0": gltf.accessor(uv * 0), "TEXCOORD_1": gltf.accessor(uv)}
    model = gltf.read()
    assert model.parts[0].corner_uv.max() == 2
    assert "clamp or mirror" in model.notes[0]


def test_vertex_colours_beside_a_texture_are_reported(gltf):
    colours = np.array([[255, 0, 0, 255]] * 4, "<u1")
    gltf.primitive["attributes"]["COLOR_0"] = gltf.accessor(colours, normalized=True)
    assert gltf.read().materials[-1].base_color == (1, 0, 0)
    gltf.document["materials"][0]["pbrMetallicRoughness"] = {"baseColorTexture": gltf.texture()}
    assert any("colours of vertices beside textures" in note for note in gltf.read().notes)


def test_gold_of_specular_glossiness_is_a_metal(gltf):
    """Its diffuse colour is black: taken alone it would be soot."""
    gltf.document["materials"][0]["extensions"] = {
        "KHR_materials_pbrSpecularGlossiness": {
            "diffuseFactor": [0, 0, 0, 1],
            "specularFactor": [1.0, 0.77, 0.34],
            "glossinessFactor": 0.8,
        }
    }
    gold = gltf.read().materials[0]
    assert gold.metallic > 0.99
    assert gold.base_color == pytest.approx((1.0, 0.77, 0.34), abs=0.02)
    assert gold.roughness == pytest.approx(0.2)
    plastic = {"diffuseFactor": [0.5, 0.2, 0.1, 1], "specularFactor": [0.04, 0.04, 0.04]}
    gltf.document["materials"][0]["extensions"]["KHR_materials_pbrSpecularGlossiness"] = plastic
    paint = gltf.read().materials[0]
    assert paint.metallic < 0.01
    assert paint.base_color == pytest.approx((0.5, 0.2, 0.1), abs=0.01)


def test_sparse_and_interleaved_accessors(gltf):
    moved = np.array([[0, 0, 2]], "<f4")
    accessor = gltf.document["accessors"][0]
    accessor["sparse"] = {
        "count": 1,
        "indices": {"bufferView": gltf.view(np.array([3], "<u2").tobytes()), "componentType": 5123},
        "values": {"bufferView": gltf.view(moved.tobytes())},
    }
    assert np.ptp(gltf.read().parts[0].positions_m, axis=0).tolist() == [1, 1, 2]
    rows = np.concatenate([CORNERS * 3, CORNERS], axis=1)
    view = gltf.view(rows.tobytes())
    gltf.document["bufferViews"][view]["byteStride"] = 24
    gltf.document["accessors"][0] = {"bufferView": view, "componentType": 5126, "count": 4, "type": "VEC3"}
    assert np.ptp(gltf.read().parts[0].positions_m, axis=0).tolist() == [3, 3, 3]
