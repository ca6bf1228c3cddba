"""Malicious meshes are refused with one sentence, before memory is allocated."""

import json
import os
import random
import sys
import threading
import time
import zlib
from pathlib import Path

import pytest
import trimesh
from gltf_model import Gltf, join_glb
from mesh_fuzz import damaged
from programs import completed

from flyaround.__main__ import run
from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.glb.read import load_glb
from flyaround.simulator.targets.glb.write import write_glb
from flyaround.simulator.targets.importing.add import ImportOptions, read_surface
from flyaround.simulator.targets.library import load_target

BOX = trimesh.creation.box((2.0, 1.0, 0.5))
BLOB = BOX.vertices.astype("<f4").tobytes() + BOX.faces.astype("<u4").tobytes()
FUZZ = Path(__file__).parents[3] / "harness" / "mesh_fuzz.py"


def document(**changes):
    """A box as glTF whose buffer is embedded, and what is to be otherwise."""
    return Gltf(BOX.vertices, BOX.faces).whole() | changes


def refused(path, options=None, seconds=20.0):
    """The sentence with which a mesh is refused; `seconds` of processor time are ten times what is needed."""
    start = time.process_time()
    with pytest.raises(UserError) as caught:
        read_surface(path, options or ImportOptions())
    assert time.process_time() - start < seconds
    text = str(caught.value)
    assert "\n" not in text
    assert len(text) < 700
    return text


def gltf(folder, **changes):
    path = folder / "a.gltf"
    path.write_text(json.dumps(document(**changes)))
    return path


@pytest.fixture
def folder(tmp_path):
    """A folder for a model, beside a file that is none of its business, and links and pipes within."""
    inner = tmp_path / "model"
    inner.mkdir()
    (tmp_path / "secret.bin").write_bytes(BLOB)
    (tmp_path / "secret.png").write_bytes(png(4, 4))
    (inner / "link.bin").symlink_to(tmp_path / "secret.bin")
    (inner / "zero.bin").symlink_to("/dev/zero")
    (inner / "round.bin").symlink_to(inner / "round.bin")
    os.mkfifo(inner / "pipe.bin")
    return inner


def png(width, height):
    """A PNG of one colour and any size: a few kilobytes for gigabytes."""

    def chunk(kind, data):
        return len(data).to_bytes(4, "big") + kind + data + zlib.crc32(kind + data).to_bytes(4, "big")

    head = width.to_bytes(4, "big") + height.to_bytes(4, "big") + b"\x08\x02\0\0\0"
    packer = zlib.compressobj(9)
    row = bytes(1 + 3 * width)
    rows = b"".join(packer.compress(row) for _ in range(min(height, 64))) + packer.flush()
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


OUTSIDE = (
    ("/etc/hostname", "not within the model's folder"),
    ("../secret.bin", "not within the model's folder"),
    ("..\\secret.bin", "not within the model's folder"),
    ("sub/../../secret.bin", "not within the model's folder"),
    ("link.bin", "not within the model's folder"),
    ("zero.bin", "not within the model's folder"),
    ("round.bin", "not within the model's folder"),
    ("C:\\secret.bin", "not within the model's folder"),
    ("\\\\server\\share\\secret.bin", "not within the model's folder"),
    ("http://example.org/a.bin", "is a URL"),
    ("file:///etc/hostname", "is a URL"),
    ("pipe.bin", "is a pipe or a device"),
    (".", "is a folder"),
    ("gone.bin", "is missing"),
    ("x" * 5000, "is missing"),
    ("a\0b", "not a valid file name"),
)


@pytest.mark.parametrize(("name", "says"), OUTSIDE, ids=[n[:12].replace("\0", "0") for n, _ in OUTSIDE])
def test_files_are_read_from_the_models_own_folder_alone(folder, name, says):
    assert says in refused(gltf(folder, buffers=[{"byteLength": 240, "uri": name}]))
    images = {
        "images": [{"uri": name}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    }
    paths = [gltf(folder, **images), folder / "a.obj", folder / "b.obj"]
    body = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl skin\nf 1 2 3\n"
    paths[1].write_text(f"mtllib {name}\n{body}")
    (folder / "b.mtl").write_text(f"newmtl skin\nmap_Kd {name}\n")
    paths[2].write_text(f"mtllib b.mtl\n{body}")
    for path in paths:
        model, *_, lines = read_surface(path, ImportOptions())
        assert model.pictures == {}
        assert sum(says in line and "drawn" in line for line in lines) == 1, lines
        assert says in refused(path, ImportOptions(strict=True))


def test_files_in_the_folder_and_below_it_are_still_read(folder):
    (folder / "data").mkdir()
    (folder / "data" / "my hull.bin").write_bytes(BLOB)
    (folder / "near.bin").symlink_to(folder / "data" / "my hull.bin")
    for name in ("data/my%20hull.bin", "./data/../near.bin"):
        bodies = read_surface(gltf(folder, buffers=[{"byteLength": 240, "uri": name}]), ImportOptions())[1]
        assert len(bodies[0].triangles) == 12


def test_a_mesh_that_is_itself_a_pipe_or_a_device(folder, capsys):
    for name, target in (("pipe.stl", None), ("zero.stl", "/dev/zero"), ("pipe.glb", None)):
        if target is None:
            os.mkfifo(folder / name)
        else:
            (folder / name).symlink_to(target)
        done = []
        # a pipe without a writer would hold a reader for ever
        thread = threading.Thread(
            target=lambda n=name, d=done: d.append(run(["targets", "add", str(folder / n)])), daemon=True
        )
        thread.start()
        thread.join(60)
        assert done == [2]
        assert "is a pipe or a device" in " ".join(capsys.readouterr().err.split())
    with pytest.raises(UserError, match="is a pipe or a device"):
        load_target(folder / "pipe.glb")


def test_a_node_that_is_reached_over_two_ways(folder):
    """41 nodes, each with the next as child twice: 2^40 visits."""
    nodes = [{"children": [k + 1, k + 1]} for k in range(40)] + [{"mesh": 0}]
    assert "nodes form no tree" in refused(gltf(folder, nodes=nodes))
    assert "nodes form no tree" in refused(gltf(folder, nodes=[{"children": [1]}, {"children": [0]}]))


def test_a_mesh_placed_ten_thousand_times_over(folder):
    shared = {"attributes": {"POSITION": 0}, "indices": 1}
    nodes = [{"children": list(range(1, 1001))}, *({"mesh": 0} for _ in range(1000))]
    many = [{"primitives": [shared] * 1000}]
    assert "far more than it holds" in refused(gltf(folder, nodes=nodes, meshes=many))


def test_a_chain_of_twenty_thousand_nodes_is_no_recursion(folder):
    nodes = [{"children": [k + 1]} for k in range(20_000)] + [{"mesh": 0}]
    bodies = read_surface(gltf(folder, nodes=nodes), ImportOptions())[1]
    assert len(bodies[0].triangles) == 12


@pytest.mark.parametrize("count", [10**9, 2**63, 10**30, -1, 1e9, None])
@pytest.mark.parametrize("number", [0, 1])
def test_counts_beyond_what_the_file_holds(folder, number, count):
    for dropped in ((), ("bufferView",)):
        accessors = document()["accessors"]
        accessors[number]["count"] = count
        for key in dropped:
            del accessors[number][key]
        assert "breaks the rules of glTF 2.0" in refused(gltf(folder, accessors=accessors))


def test_json_that_nests_or_counts_without_end(folder):
    path = folder / "a.gltf"
    whole = json.dumps(document())
    path.write_text(whole[:-1] + ', "extras": ' + "[" * 100_000 + "]" * 100_000 + "}")
    assert "nest too deep" in refused(path)
    path.write_text(whole[:-1] + ', "extras": [' + "{}," * 3_000_000 + "{}]}")
    assert "values, and 2,000,000 are the most" in refused(path)
    path.write_text(whole[:-1] + ', "x": NaN}')
    assert "NaN is not a JSON number" in refused(path)
    nested = '"extras": ' + "[" * 100_000 + "]" * 100_000
    join_glb(folder / "a.glb", json.dumps(document(extras=0)).replace('"extras": 0', nested).encode())
    assert "nest too deep" in refused(folder / "a.glb")
    with pytest.raises(UserError, match="nest too deep"):
        load_glb(folder / "a.glb")


@pytest.mark.parametrize(
    ("face", "says"),
    [
        ("5/1 7/x 8/3", "cannot be read"),
        ("1 2 x", "cannot be read"),
        ("-1 -x -2", "cannot be read"),
        ("1//x 2//1 3//1", "cannot be read"),
        ("99999999999999999999 1 2", "uses vertex"),
        ("1 2 1.5", "cannot be read"),
        ("1/9 2/9 3/9", "uses vt 9 of 0"),
        ("-9 -1 -2", "uses vertex"),
    ],
)
def test_faces_of_obj_that_are_no_numbers(folder, face, says):
    (folder / "a.obj").write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf {face}\n")
    assert says in refused(folder / "a.obj")


@pytest.mark.parametrize("line", ["Kd nan 1 1", "Kd 1 1", "Kd x", "Ns inf inf", "Pr nan", "Pm -", "Ns"])
def test_values_of_mtl_that_are_no_numbers(folder, line):
    (folder / "a.mtl").write_text(f"newmtl skin\n{line}\n")
    (folder / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl skin\nf 1 2 3\n")
    text = refused(folder / "a.obj", ImportOptions(strict=True))
    assert "has a value that is not a number" in text or "open edges" in text  # Ns inf is a mirror


@pytest.mark.parametrize(("width", "height"), [(32_000, 32_000), (2**31 - 1, 1), (20_000, 4000), (0, 5)])
def test_pictures_are_weighed_before_they_are_decoded(folder, width, height):
    data = png(width, height) if 0 < width < 2**20 else png(1, 1)
    if not 0 < width < 2**20:
        data = data[:16] + width.to_bytes(4, "big") + height.to_bytes(4, "big") + data[24:]
    assert len(data) < 200_000
    (folder / "big.png").write_bytes(data)
    (folder / "a.mtl").write_text("newmtl skin\nmap_Kd big.png\n")
    (folder / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl skin\nf 1 2 3\n")
    text = refused(folder / "a.obj", ImportOptions(strict=True))
    assert "'big.png'" in text
    assert "make it smaller" in text or "not a picture that can be read" in text


def test_one_picture_in_a_thousand_materials_is_read_once(folder):
    (folder / "skin.png").write_bytes(png(64, 64))
    (folder / "a.mtl").write_text("".join(f"newmtl m{k}\nmap_Kd skin.png\n" for k in range(1000)))
    faces = "".join(f"usemtl m{k}\nf 1 2 3\n" for k in range(1000))
    (folder / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n" + faces)
    model, *_ = read_surface(folder / "a.obj", ImportOptions(keep_holes=True, keep_non_manifold=True))
    assert len(model.pictures) == 1


def test_more_parts_than_a_craft_has(folder):
    lines = ["v 0 0 0", "v 1 0 0", "v 0 1 0", *(f"o p{k}\nf 1 2 3" for k in range(5000))]
    (folder / "a.obj").write_text("\n".join(lines))
    assert "5,000 parts" in refused(folder / "a.obj")


@pytest.mark.parametrize("count", [120, pytest.param(600, marks=pytest.mark.slow)])
def test_meshes_damaged_at_random_are_taken_or_refused_in_a_sentence(count, tmp_path):
    """Damaged files of six kinds, under 1 GB of data: nothing but sentences (6,600 by hand)."""
    done = completed(sys.executable, FUZZ, tmp_path, "20261123", count)
    assert done.returncode == 0, done.stderr[-2000:]
    found = json.loads(done.stdout)
    assert found["wrong"] == []
    assert found["taken"] + found["refused"] == count
    assert found["taken"] > count / 20
    assert found["longest"][0] < 10.0  # 0.04 s where this was written
    assert found["memory_bytes"] < 1 << 30
    assert "Traceback" not in done.stderr


def test_target_files_damaged_at_random_are_taken_or_refused_in_a_sentence(tmp_path):
    """Their JSON, which says what is where, at random (1,500 by hand)."""
    write_glb(load_target("chessboard", "low"), tmp_path / "whole.glb")
    data = (tmp_path / "whole.glb").read_bytes()
    size = int.from_bytes(data[12:16], "little")
    rng = random.Random(20261123)
    refusals = []
    for _ in range(60):
        join_glb(tmp_path / "a.glb", damaged(rng, data[20 : 20 + size]), data[28 + size :])
        try:
            load_glb(tmp_path / "a.glb")
        except UserError as error:
            refusals.append(str(error))
    assert len(refusals) > 30
    assert not any("\n" in text for text in refusals)
