"""Text files as Windows' editors save them: a BOM before UTF-8 is passed over, UTF-16 is named for what it is."""

import msgspec
import numpy as np
import pytest

from flyaround.simulator.camera.lens.files import read_camera_file
from flyaround.simulator.camera.lens.formats.registry import camera_text
from flyaround.simulator.camera.sections import OpticsSection
from flyaround.simulator.dataset.card import decode_card
from flyaround.simulator.dataset.formats.posed_pictures import read_csv, read_json
from flyaround.simulator.dataset.split import read_split
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import read_record_bytes
from flyaround.simulator.runtime.untrusted_files import decode_text
from flyaround.simulator.scenario.faults import read_faults
from flyaround.simulator.scenario.load import built_in_text, load_recipe, load_scenario, load_vary
from flyaround.simulator.scenario.poses import read_poses
from flyaround.simulator.scenario.show import show_scenario

CAMERA = read_camera_file("speed")
TEXTS = {
    "scenario.toml": (load_scenario, show_scenario("tango-space-10m")),
    "recipe.toml": (load_recipe, built_in_text("recipe", "eval-black")),
    "vary.toml": (load_vary, "[craft]\n"),
    "faults.toml": (read_faults, "seed = 3\n"),
    "camera.json": (read_camera_file, camera_text(CAMERA, "native", "x")),
    "camera.yaml": (read_camera_file, camera_text(CAMERA, "ros", "x")),
    "opencv.yaml": (read_camera_file, camera_text(CAMERA, "opencv", "x")),
    "poses.csv": (read_poses, "q_w,q_x,q_y,q_z,t_x_m,t_y_m,t_z_m\n1,0,0,0,0,0,9\n"),
    "list.csv": (lambda path: read_csv(path, ["a"]), "a,b\n1,2\n"),
    "kernel.csv": (
        lambda path: OpticsSection(psf="kernel", kernel_file=path.name).with_kernel(path.parent, "x"),
        "0.5,0.25,0.25\n",
    ),
    "split.json": (
        lambda path: read_split(path.parent),
        '{"schema": "flyaround.split", "version": 1, "shares": {}, "seed": 0, "frames": {}}',
    ),
}


def _save(folder, name, data):
    folder.mkdir(exist_ok=True)
    (folder / name).write_bytes(data)
    return folder / name


@pytest.mark.parametrize("name", [name for name in TEXTS if name != "split.json"])
def test_a_byte_order_mark_and_crlf_change_nothing(name, tmp_path):
    reader, text = TEXTS[name]
    plain = _save(tmp_path / "plain", name, text.encode())
    marked = _save(tmp_path / "marked", name, text.replace("\n", "\r\n").encode("utf-8-sig"))
    assert reader(marked) == reader(plain)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be", "utf-32"])
@pytest.mark.parametrize("name", TEXTS)
def test_other_encodings_are_named(name, encoding, tmp_path):
    reader, text = TEXTS[name]
    path = _save(tmp_path, name, text.encode(encoding))
    with pytest.raises(UserError, match="UTF-16" if "16" in encoding else "UTF-32|UTF-16") as caught:
        reader(path)
    assert "save it as UTF-8" in str(caught.value)


def test_json_records_take_a_mark(tmp_path):
    path = _save(tmp_path, "a.json", '{"a": [1.5]}'.encode("utf-8-sig"))
    assert msgspec.json.decode(read_record_bytes(path)) == {"a": [1.5]} == read_json(path)
    with pytest.raises(UserError, match="missing required field"):  # it was parsed
        decode_card(b"\xef\xbb\xbf{}", "dataset.json")


def test_a_letter_of_another_code_page_is_found_by_its_line():
    assert decode_text("grün".encode(), "a") == "grün"
    with pytest.raises(UserError, match=r"a is not UTF-8 text \(line 2: byte 0xfc; it may be Latin-1"):
        decode_text("x\ngrün".encode("cp1252"), "a")
    assert np.array_equal(decode_text(b"", "a"), "")
