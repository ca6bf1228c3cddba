"""Meshes of other programs (.ply .off .dae .3mf .step), converted to glTF by libraries in a process of their own."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.importing.read.bounded_process import DecoderError, run_decoder
from flyaround.simulator.targets.importing.read.gltf import read_gltf
from flyaround.simulator.targets.importing.read.textures import linear_from_srgb

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.targets.importing.read.raw_model import RawModel

KINDS = {"ply": "PLY", "off": "OFF", "dae": "COLLADA", "3mf": "3MF", "step": "STEP", "stp": "STEP"}
"""Endings, and names of the formats."""


def read_foreign(path: Path, kind: str, data: bytes) -> RawModel:
    """Read a mesh by trimesh, or a STEP model by Open CASCADE.

    Units and the axis that points up are those that COLLADA, 3MF and STEP files state; PLY and OFF files state none.
    Colours of PLY and OFF files are taken as sRGB, those of COLLADA's materials as linear, as of .mtl files.

    Parameters
    ----------
    kind : str
        One of `KINDS`.

    Raises
    ------
    UserError
        If the libraries are missing or cannot read it.
    """
    kind = "step" if kind == "stp" else kind
    try:
        line, _, glb = run_decoder("foreign_process", [kind, str(path)], data).partition(b"\n")
    except DecoderError as error:
        why = str(error)
        if why.startswith("MISSING"):
            raise UserError(
                f"reading {KINDS[kind]} needs more libraries ({why.removeprefix('MISSING ')}): "
                "pip install 'flyaround[meshes]', or export the model as .glb"
            ) from error
        raise UserError(f"{path} cannot be read as {KINDS[kind]} ({why}); export it as .glb") from error
    facts = json.loads(line)
    model = read_gltf(path, glb)
    model.kind, model.up, model.in_metres = KINDS[kind], facts["up"], facts["metres"] is not None
    for part in model.parts:
        if facts["metres"] is not None:
            part.positions_m = part.positions_m * facts["metres"]
        if part.face_colour is not None and kind in ("ply", "off"):
            part.face_colour = linear_from_srgb(part.face_colour)
    model.notes += [f"not carried over: {what}" for what in dict.fromkeys(facts["lost"])]
    if kind == "3mf" and (b"PK" in data[:2]):
        model.notes.append("colours of 3MF are not read: given a mid-grey paint")
    return model
