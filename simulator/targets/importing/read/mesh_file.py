"""Reading of mesh files as raw parts, by suffix. The contents must match the suffix."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import read_regular
from flyaround.simulator.targets.glb.read import MAX_FILE_BYTES
from flyaround.simulator.targets.importing.read.bounded_process import DecoderError, run_decoder
from flyaround.simulator.targets.importing.read.foreign_process import MISSING
from flyaround.simulator.targets.importing.read.gltf import read_gltf
from flyaround.simulator.targets.importing.read.named_files import split_word, text_lines
from flyaround.simulator.targets.importing.read.obj import read_obj
from flyaround.simulator.targets.importing.read.stl import is_stl, read_stl
from flyaround.simulator.targets.importing.read.textures import bake_colours, linear_from_srgb

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.targets.importing.read.raw_model import RawModel


KINDS = {"ply": "PLY", "off": "OFF", "dae": "COLLADA", "3mf": "3MF", "step": "STEP", "stp": "STEP"}
"""Suffixes and names of the formats."""
ENDINGS = ("glb", "gltf", "obj", "stl", *KINDS)
OBJ_WORDS = {"v", "vn", "vt", "f", "o", "g", "mtllib", "usemtl", "s", "vp", "l", "p"}
SIGNATURES = {b"ply": "ply", b"OFF": "off", b"COFF": "off", b"NOFF": "off", b"ISO-10303-21": "step"}
UNSUPPORTED_SIGNATURES = {
    b"version https://git-lfs": "a Git LFS pointer instead of the mesh (`git lfs pull` brings it)",
    b"PK": "a ZIP archive (USDZ or packed files)",
    b"\x89PN": "a PNG image",
    b"\xff\xd8": "a JPEG image",
    b"Kayd": "a binary FBX model",
    b"BLEN": "a Blender scene",
    b"<": "XML (X3D or a web page)",
}


def read_mesh(path: Path) -> RawModel:
    """Read a mesh file unchanged, with vertex colours grouped into a few materials.

    Raises
    ------
    UserError
        If it cannot be read, does not match its suffix, or names missing files.
    """
    kind = path.suffix.lower().lstrip(".")
    if kind not in ENDINGS:
        raise UserError(
            f"{path}: meshes of kind {path.suffix or 'without ending'} are not supported; export it as .glb"
        )
    try:
        data = read_regular(path, MAX_FILE_BYTES)
    except OSError as error:
        raise UserError(f"cannot read {path}: {error.strerror}; check the path") from error
    if not data.strip():
        raise UserError(f"{path} is empty; export the model again")
    detected = detected_format(data)
    kind = "step" if kind == "stp" else kind
    # a binary STL has no signature
    if detected != kind and not (detected == "" and kind == "stl"):
        contents = f"a .{detected} file" if detected in ENDINGS else detected or "no mesh that is known"
        hint = (
            f"rename it to {path.with_suffix('.' + detected).name}"
            if detected in ENDINGS
            else "export it as .glb"
        )
        raise UserError(f"{path} ends in .{kind} but holds {contents}; {hint}")
    match kind:
        case "glb" | "gltf":
            model = read_gltf(path, data)
        case "obj":
            model = read_obj(path, data)
        case "stl":
            model = read_stl(path, data)
        case _:
            model = read_foreign(path, kind, data)
    model.parts = [p for p in model.parts if len(p.triangles)]
    if not model.parts:
        raise UserError(f"{path} holds no triangles; export the model as a mesh, not as points or curves")
    bake_colours(model)
    return model


def detected_format(data: bytes) -> str:
    """Detect the format of a file by its contents.

    Returns
    -------
    str
        Suffix of a supported format, description of an unsupported one, or an empty string.
    """
    if data[:4] == b"glTF":
        return "glb"
    if is_stl(data):
        return "stl"
    head = data[:4096].removeprefix(b"\xef\xbb\xbf").lstrip()
    if head[:1] == b"{":
        return "gltf"
    for magic, kind in SIGNATURES.items():
        if head.startswith(magic):
            return kind
    if head[:1] == b"<" and b"<COLLADA" in head:
        return "dae"
    if data[:2] == b"PK" and b"3D/" in data:
        return "3mf"
    for magic, description in UNSUPPORTED_SIGNATURES.items():
        if head.startswith(magic):
            return description
    first_words = [split_word(line)[0].lower() for line in text_lines(data[:65536])[:-1] or text_lines(data)]
    statements = [w for w in first_words if w and not w.startswith("#")]
    if not statements or sum(w in OBJ_WORDS for w in statements) > len(statements) // 2:
        return "obj"
    return ""


def read_foreign(path: Path, kind: str, data: bytes) -> RawModel:
    """Read a mesh with trimesh, or a STEP model with Open CASCADE.

    Units and up axis are those stated by COLLADA, 3MF and STEP files; PLY and OFF files state none. Colours of PLY and
    OFF files are interpreted as sRGB, those of COLLADA's materials as linear, like those of .mtl files.

    Parameters
    ----------
    path : Path
        Path of the file.
    kind : str
        One of `KINDS`.
    data : bytes
        Content of the file.

    Raises
    ------
    UserError
        If the libraries are missing or cannot read it.
    """
    kind = "step" if kind == "stp" else kind
    try:
        line, _, glb = run_decoder("foreign_process", [kind, str(path)], data).partition(b"\n")
    except DecoderError as error:
        reason = str(error)
        if reason.startswith(MISSING):
            raise UserError(
                f"reading {KINDS[kind]} needs more libraries ({reason.removeprefix(f'{MISSING} ')}): "
                "pip install 'flyaround[meshes]', or export the model as .glb"
            ) from error
        raise UserError(f"{path} cannot be read as {KINDS[kind]} ({reason}); export it as .glb") from error
    facts = json.loads(line)
    model = read_gltf(path, glb)
    model.kind, model.up, model.in_metres = KINDS[kind], facts["up"], facts["metres"] is not None
    for part in model.parts:
        if facts["metres"] is not None:
            part.positions_m = part.positions_m * facts["metres"]
        if part.face_colour is not None and kind in ("ply", "off"):
            part.face_colour = linear_from_srgb(part.face_colour)
    model.notes += [f"not carried over: {item}" for item in dict.fromkeys(facts["lost"])]
    if kind == "3mf" and (b"PK" in data[:2]):
        model.notes.append("colours of 3MF are not read: given a mid-grey paint")
    return model
