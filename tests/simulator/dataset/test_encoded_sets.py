"""A data set of encoded images: its record names the curve, its check undoes it, and its images come again."""

import json
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from flyaround.__main__ import run
from flyaround.simulator.camera.encoding import encode
from flyaround.simulator.dataset.check.clean_twin import check_clean
from flyaround.simulator.dataset.check.redraw import check_same_picture
from flyaround.simulator.dataset.check.signal import check_states_by_signal
from flyaround.simulator.dataset.check.verify import check_dataset
from flyaround.simulator.dataset.formats.native import frame_paths, read_layer, read_png
from flyaround.simulator.labels.truth import read_truth

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def inspection(tmp_path_factory):
    folder = tmp_path_factory.mktemp("encoded") / "set"
    options = ["-n", "2", "--quality", "draft", "--labels", "clean", "--format", "bop,coco,speed"]
    assert run(["capture", "inspection", "-o", str(folder), *options]) == 0
    return folder


def test_colour_of_eight_bits_is_srgb_and_every_file_says_so(inspection):
    card = json.loads((inspection / "dataset.json").read_text())
    record = json.loads(frame_paths(inspection, 0).truth.read_text())
    assert card["camera"]["encoding"] == record["camera"]["encoding"] == "srgb"
    assert record["scene"]["camera"]["encoding"] == "srgb"
    assert json.loads((inspection / "bop" / "camera.json").read_text())["encoding"] == "srgb"
    lists = [json.loads(path.read_text()) for path in (inspection / "coco").rglob("*.json")]
    assert {i["encoding"] for one in lists for i in one.get("images", [])} == {"srgb"}
    assert json.loads((inspection / "speed" / "camera.json").read_text())["encoding"] == "srgb"


def test_the_check_undoes_the_curve(inspection):
    report = check_dataset(inspection, redraw=1.0)
    assert (report.n_redrawn, report.faults) == (2, ())


def test_an_image_with_another_curve_is_found(inspection):
    paths = frame_paths(inspection, 0)
    truth, image = read_truth(paths.truth), read_png(paths.image)
    mask, clean = read_png(paths.mask), read_layer(inspection / "images", "000000", "clean")
    assert check_clean(truth, image, mask, clean) == []
    brighter = np.rint(255 * encode(image / 255, "srgb")).astype(np.uint8)
    assert check_clean(truth, brighter, mask, clean)
    assert check_same_picture(truth, brighter, image, mask)
    # the same bytes under another name are another picture
    linear = replace(truth.camera, encoding="linear")
    assert linear != truth.camera


def test_a_state_that_a_colour_image_denies_is_found(inspection):
    """Also where a colour matrix has mixed the detector's bands."""
    paths = frame_paths(inspection, 0)
    truth, clean = read_truth(paths.truth), read_layer(inspection / "images", "000000", "clean")
    assert check_states_by_signal(truth, clean) == []
    found = 0
    for k, point in enumerate(truth.keypoints):
        if point.state == "visible":
            wrong = msgspec.structs.replace(point, state="saturated")
            changed = msgspec.structs.replace(
                truth, keypoints=(*truth.keypoints[:k], wrong, *truth.keypoints[k + 1 :])
            )
            found += bool(check_states_by_signal(changed, clean))
    assert found


def test_an_encoded_picture_comes_again_from_its_record(tmp_path):
    first, again = tmp_path / "a.png", tmp_path / "b.png"
    assert run(["render", "tango-limb", "--rgb", "--quality", "draft", "-o", str(first)]) == 0
    assert run(["render", "--from-truth", str(first.with_suffix(".json")), "-o", str(again)]) == 0
    assert first.read_bytes() == again.read_bytes()


def test_a_curve_that_the_sensor_cannot_have_is_refused(tmp_path, capsys):
    assert run(["render", "tango-limb", "--encoding", "srgb", "-o", str(tmp_path / "a.png")]) == 0
    scenario = tmp_path / "deep.toml"
    scenario.write_text(
        'epoch_utc = "2026-08-20T09:30:00Z"\nduration_s = 60.0\n[orbit]\nkind = "elements"\naltitude_km = 700.0\n'
        'inclination_deg = 98.2\nraan_deg = 14.7\ntrue_anomaly_deg = 95.3\n[chaser]\nmode = "hold"\n'
        'position_lvlh_m = [6.0, 6.0, 3.0]\n[sensor]\npreset = "imx174"\n[output]\nencoding = "srgb"\n'
    )
    assert run(["render", str(scenario), "-o", str(tmp_path / "b.png")]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "output.encoding is srgb and sensor.bits 12, allowed: 8 bits, or linear" in said
    assert not (tmp_path / "b.png").exists()
