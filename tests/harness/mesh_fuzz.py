"""Meshes damaged at random through the import, in a process whose memory is bounded: run as a program.

Prints a JSON object: how many were taken and refused, what was raised that is no sentence, the longest, and the memory.
"""

import json
import random
import resource
import struct
import sys
import time
import traceback
import warnings
from pathlib import Path

import cv2
import numpy as np
import trimesh
from peak_memory import peak_bytes

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.glb.read import load_glb
from flyaround.simulator.targets.importing.add import ImportOptions, read_surface

MOST_BYTES = 1 << 30
OPTIONS = (
    ImportOptions(),
    ImportOptions(units="m", keep_holes=True, keep_non_manifold=True, recentre=True),
    ImportOptions(units="m", fill_holes=True, keep_holes=True, keep_non_manifold=True, recentre=True),
    ImportOptions(units="m", keep_holes=True, keep_non_manifold=True, recentre=True, decimate=500),
)
NUMBERS = (
    "-1", "0", "1e9", "1e999", "4294967295", "1e-320", "null", '"x"', "[]", "{}", "999999999999999999999",
    "0.5", "true",
)  # fmt: skip
WORDS = (
    "nan", "inf", "-0", "1e999", "x", "", "/", "//", "-1", "99999999999999999999", "0", "f", "v", "usemtl",
    "\0", "#",
)  # fmt: skip


def picture():
    """A small PNG."""
    return cv2.imencode(".png", np.arange(192, dtype=np.uint8).reshape(8, 8, 3))[1].tobytes()


def seeds(folder):
    """Whole files to damage: name and bytes."""
    (folder / "skin.png").write_bytes(picture())
    box = trimesh.creation.box((2.0, 1.0, 0.5))
    box.unmerge_vertices()
    skin = trimesh.visual.material.PBRMaterial(name="skin", baseColorTexture=_pil(folder / "skin.png"))
    box.visual = trimesh.visual.TextureVisuals(uv=box.vertices[:, :2] % 1.0, material=skin)
    yield (
        "a.glb",
        trimesh.Scene({"hull": box, "mast": trimesh.creation.cylinder(0.1, 1.0, sections=8)}).export(
            file_type="glb"
        ),
    )
    blob = box.vertices.astype("<f4").tobytes() + box.faces.astype("<u4").tobytes()
    (folder / "a.bin").write_bytes(blob)
    n = len(box.vertices)
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"children": [1], "scale": [1, 1, 1]}, {"mesh": 0, "translation": [0, 0, 1]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0, "mode": 4}]}],
        "materials": [
            {"name": "skin", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1], "metallicFactor": 0.5}}
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": n, "type": "VEC3", "byteOffset": 0},
            {"bufferView": 1, "componentType": 5125, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": n * 12, "byteOffset": 0},
            {"buffer": 0, "byteOffset": n * 12, "byteLength": 144},
        ],
        "buffers": [{"byteLength": len(blob), "uri": "a.bin"}],
    }
    yield "a.gltf", json.dumps(document).encode()
    v = [f"v {x} {y} {z}" for x, y, z in trimesh.creation.box((2, 1, 0.5)).vertices]
    f = [f"f {a + 1}/1 {b + 1}/2 {c + 1}/3" for a, b, c in trimesh.creation.box().faces]
    text = [
        "mtllib a.mtl",
        "o hull",
        *v,
        "vt 0 0",
        "vt 1 0",
        "vt 0 1",
        "usemtl skin",
        *f,
        "g fin",
        "f -1 -2 -3",
    ]
    (folder / "a.mtl").write_text("newmtl skin\nKd 1 0 0\nNs 10\nmap_Kd skin.png\n")
    yield "a.obj", "\n".join(text).encode()
    yield "b.obj", "\n".join(text).replace("a.mtl", "b.mtl").encode()
    yield "a.stl", trimesh.creation.icosphere(1).export(file_type="stl")
    yield "b.stl", trimesh.creation.box((2, 1, 0.5)).export(file_type="stl_ascii").encode()


def _pil(path):
    from PIL import Image

    return Image.open(path)


def damaged(rng, data):
    """The bytes with a few of them changed, moved, cut out or repeated; in text also words and numbers."""
    data = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4))):
        at, span = rng.randrange(len(data) + 1), rng.randrange(1, 40)
        kind = rng.randrange(6)
        if kind == 0 and data:
            data[min(at, len(data) - 1)] = rng.randrange(256)
        elif kind == 1:
            del data[at : at + span]
        elif kind == 2:
            data[at:at] = data[at : at + span] * rng.choice((1, 50))
        elif kind == 3:
            data[at : at + 4] = struct.pack(
                "<I", rng.choice((0, 1, 0x7FFFFFFF, 0xFFFFFFFF, 0x3F800000, 1 << 20))
            )
        else:
            _change_word(rng, data, at)
    return bytes(data)


def _change_word(rng, data, at):
    """A number of a JSON text, or a word of another one, made another."""
    stop = next((k for k in range(at, len(data)) if data[k] in b" ,]}\n:/"), len(data))
    start = next((k for k in range(stop - 1, -1, -1) if data[k] in b" ,[{\n:/"), -1) + 1
    pool = NUMBERS if b'"' in data[:400] else WORDS
    data[start:stop] = rng.choice(pool).encode()


def main(folder, seed, count):
    """Damage, import, count."""
    warnings.simplefilter("error")
    resource.setrlimit(resource.RLIMIT_DATA, (MOST_BYTES, MOST_BYTES))
    rng = random.Random(seed)
    whole = list(seeds(folder))
    taken = refused = 0
    wrong, longest = [], (0.0, "")
    for number in range(count):
        name, data = whole[number % len(whole)]
        path = folder / f"{number}-{name}"
        if name == "b.obj":  # its library is what is damaged
            (folder / "b.mtl").write_bytes(damaged(rng, (folder / "a.mtl").read_bytes()))
        path.write_bytes(data if name == "b.obj" else damaged(rng, data))
        start = time.process_time()
        try:
            read_surface(path, OPTIONS[rng.randrange(len(OPTIONS))])
            taken += 1
        except UserError as error:
            refused += 1
            if "\n" in str(error) or len(str(error)) > 1000:
                wrong.append(f"{path.name}: not one sentence: {error}")
        except BaseException:  # noqa: BLE001 - any is what is looked for
            wrong.append(f"{path.name}: {traceback.format_exc()[-1500:]}")
        if name == "a.glb":
            try:
                load_glb(path)
            except UserError:
                pass
            except BaseException:  # noqa: BLE001 - the same
                wrong.append(f"{path.name}: {traceback.format_exc()[-1500:]}")
        longest = max(longest, (time.process_time() - start, path.name))
    memory = peak_bytes()
    found = {
        "taken": taken,
        "refused": refused,
        "wrong": wrong[:8],
        "longest": longest,
        "memory_bytes": memory,
    }
    sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
