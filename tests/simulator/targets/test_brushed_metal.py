"""Brushed metal in target files and glTF models: strength and direction of the grain."""

import numpy as np
import pytest
from gltf_model import Gltf

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.check_target import check_materials
from flyaround.simulator.targets.glb.read import load_glb
from flyaround.simulator.targets.glb.write import write_glb
from flyaround.simulator.targets.importing.add import ImportOptions, import_mesh
from flyaround.simulator.targets.importing.read.brushed import common_grain
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.targets.model import Material

SHEET = ImportOptions(keep_holes=True)


def test_a_craft_with_brushed_parts_is_read_back_the_same(tmp_path):
    craft = load_target("dragon")
    write_glb(craft, tmp_path / "dragon.glb")
    back = load_glb(tmp_path / "dragon.glb")
    assert back.sha256 == craft.sha256
    assert back.materials == craft.materials
    assert any(m.anisotropy > 0 for m in back.materials)


def plate_gltf(path, *, rotation_rad=0.0, tangent=None, uv_turn_rad=None):
    """A square metre in the plane of x and z, facing y, as a modelling tool writes it."""
    p = np.array([(0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0)], "<f4")
    plate = Gltf(p, np.array([(0, 1, 2), (0, 2, 3)]))
    plate.attribute("NORMAL", np.tile(np.array([0, 1, 0], "<f4"), (4, 1)))
    if tangent is not None:
        plate.attribute("TANGENT", np.tile(np.array([*tangent, 1], "<f4"), (4, 1)))
    if uv_turn_rad is not None:
        c, s = np.cos(uv_turn_rad), np.sin(uv_turn_rad)
        # seen from y, x to the right and z down: u runs along x turned clockwise as v runs down
        plate.attribute("TEXCOORD_0", (p[:, [0, 2]] @ np.array([[c, -s], [s, c]])).astype("<f4"))
    extension = {"anisotropyStrength": 0.7, "anisotropyRotation": rotation_rad}
    plate.paint(name="steel", extensions={"KHR_materials_anisotropy": extension})
    plate.document["extensionsUsed"] = ["KHR_materials_anisotropy"]
    return plate.write(path)


@pytest.mark.parametrize(
    ("made", "grain"),
    [
        # the highlight is wide along the tangent, so the scratches run across it; the file's z becomes -y
        ({"tangent": (1, 0, 0)}, (0, 1, 0)),
        ({"tangent": (1, 0, 0), "rotation_rad": np.pi / 2}, (1, 0, 0)),
        ({"tangent": (1, 0, 0), "rotation_rad": np.pi / 6}, (-0.5, np.sqrt(0.75), 0)),
        ({"uv_turn_rad": 0.0}, (0, 1, 0)),
        ({"uv_turn_rad": 0.4}, (np.sin(0.4), np.cos(0.4), 0)),
    ],
)
def test_grain_follows_the_tangents_of_a_model(tmp_path, made, grain):
    target, *_ = import_mesh(plate_gltf(tmp_path / "plate.gltf", **made), "plate", SHEET)
    (steel,) = target.materials
    assert steel.anisotropy == pytest.approx(0.7)
    assert abs(np.dot(steel.grain, grain)) == pytest.approx(1.0, abs=1e-5)


def test_brushing_without_a_direction_is_told(tmp_path):
    target, lines, _ = import_mesh(plate_gltf(tmp_path / "plate.gltf"), "plate", SHEET)
    assert target.materials[0].anisotropy == 0
    assert any("brushing" in line for line in lines)
    with pytest.raises(UserError, match="in no direction"):
        check_materials([Material(name="steel", anisotropy=0.5, base_color=(1, 1, 1))], "here")


def test_metal_from_a_lathe_is_recognised():
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    around = np.stack([-np.sin(turn), np.cos(turn), np.zeros(24)], axis=1)
    found = common_grain(np.einsum("fi,fj->ij", around, around))
    assert found.turned
    assert found.fits
    assert abs(found.axis[2]) == pytest.approx(1.0)
    mixed = common_grain(np.eye(3))
    assert not mixed.fits
