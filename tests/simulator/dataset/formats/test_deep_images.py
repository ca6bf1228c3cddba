"""Images of a 12 bit detector in every format, as the loaders of trainers read them."""

import dataclasses
import io
import json
import shutil
import tarfile
from importlib.util import find_spec

import cv2
import msgspec
import numpy as np
import pytest
from PIL import Image

import flyaround as fa
from flyaround.__main__ import run
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.formats.parquet import columns, readme
from flyaround.simulator.dataset.formats.registry import NATIVE, writable
from flyaround.simulator.labels.truth import read_truth

AS_NUMBERS = ("npz", "exr")
N = 2


@pytest.fixture(scope="module")
def deep(tmp_path_factory):
    """Capture two frames of 12 bits into every format, sky and craft."""
    scenario = msgspec.structs.replace(fa.load_scenario("tango-flyaround"), target="tango@low")
    sensor = msgspec.structs.replace(scenario.sensor, preset="imx174", bits=None, exposure_s=1.5e-4)
    scenario = msgspec.structs.replace(scenario, sensor=sensor)
    plan = fa.plan_flight(scenario, n=N, quality="draft")
    plan = dataclasses.replace(plan, camera=plan.camera.resized(384))
    folder = tmp_path_factory.mktemp("deep") / "set"
    names = [name for name in writable() if name != "parquet" or find_spec("pyarrow")]
    told = []
    fa.capture(plan, folder, formats=tuple(names), labels=("clean",), tell=told.append)
    return folder, told


def decoded_by_loaders(data):
    """Images of three bands as Ultralytics (cv2.imread's default) and datasets over Pillow make of a file."""
    yield cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., 0]
    yield np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))[..., 0]


def pictures(folder, name):
    """Files of images in the folder of a format, by frame."""
    found = {}
    for path in sorted((folder / name).rglob("*")):
        if name == "webdataset" and path.suffix == ".tar":
            with tarfile.open(path) as tar:
                for member in tar.getmembers():
                    number, _, ending = member.name.partition(".")
                    if ending in ("png", "clean.png"):
                        found.setdefault(int(number), []).append(tar.extractfile(member).read())
        elif name == "parquet" and path.suffix == ".parquet":
            import pyarrow.parquet

            for row in pyarrow.parquet.read_table(path).to_pylist():
                found.setdefault(row["number"], []).append(row["image"]["bytes"])
        elif name == "mcap" and path.suffix == ".mcap":
            from mcap.reader import make_reader
            from mcap_ros2.decoder import DecoderFactory

            reader = make_reader(io.BytesIO(path.read_bytes()), decoder_factories=[DecoderFactory()])
            for k, message in enumerate(reader.iter_decoded_messages(["/camera/image_raw/compressed"])):
                found.setdefault(k, []).append(bytes(message.decoded_message.data))
        elif path.suffix in (".jpg", ".png") and not {"mask", "mask_visib", "depth"} & set(path.parts):
            number = int("".join(c for c in path.stem if c.isdigit()))
            found.setdefault(number, []).append(path.read_bytes())
    return found


@pytest.mark.gl
@pytest.mark.parametrize("name", [n for n in writable() if n not in (NATIVE, *AS_NUMBERS)])
def test_loaders_of_eight_bits_see_the_native_image(deep, name):
    folder, _ = deep
    if not (folder / name).exists():
        pytest.skip(f"the library of {name} is not installed")
    found = pictures(folder, name)
    assert sorted(found) == list(range(N))
    for frame in fa.open_dataset(folder):
        assert frame.image.dtype == np.uint16
        assert 2000 < frame.image.max() <= 4095
        wanted = frame.image * (255 / 4095)
        for data in found[frame.number]:
            for seen in decoded_by_loaders(data):
                # JPEG's own error, and the noise that a clean twin has not
                assert np.abs(seen - wanted).mean() < 2.5
                assert seen.max() == pytest.approx(wanted.max(), abs=25)
    assert "12 bits times 255 / 4095" in (folder / name / "README.md").read_text()


@pytest.mark.gl
def test_numbers_stay_where_they_are_read_as_numbers(deep):
    folder, _ = deep
    frame = fa.open_dataset(folder)[0]
    with np.load(folder / "npz" / "train" / "000000.npz") as arrays:
        assert (arrays["image"] == frame.image).all()
        assert arrays["image_bits"] == 12
    for name in AS_NUMBERS:
        assert not (folder / name / "README.md").exists()


@pytest.mark.gl
def test_the_scale_is_said_in_card_truth_and_before_drawing(deep):
    folder, told = deep
    card = read_card(folder)
    assert card.image_bits == 12
    assert "image_bits" in card.conventions["image"]
    truth = read_truth(folder / "images" / "000000.json")
    assert truth.scene.sensor.bits == 12
    assert "12 bits times 255 / 4095" in readme(
        card, {"train": N}, columns(())
    )  # Parquet's own, without its library
    scaled = {s.split()[0] for s in told if "12 bits times 255 / 4095" in s}
    assert scaled == set(card.formats) - {NATIVE, *AS_NUMBERS}


@pytest.mark.gl
def test_a_set_of_an_older_card_is_converted_with_the_scale_said(deep, tmp_path, capsys):
    folder, _ = deep
    card = json.loads((folder / "dataset.json").read_text())
    del card["image_bits"]
    old = tmp_path / "old"
    old.mkdir()
    shutil.copytree(folder / "images", old / "images")
    (old / "dataset.json").write_text(json.dumps(card))
    assert run(["convert", str(old), "-o", str(tmp_path / "out"), "--format", "coco"]) == 0
    assert "12 bits times 255 / 4095" in " ".join(capsys.readouterr().err.split())
    image = cv2.imread(str(next((tmp_path / "out").rglob("000000.png"))))
    assert image.max() > 100


@pytest.mark.parametrize(
    ("section", "saturation_e"),
    [
        ('preset = "imx174"\nbits = 8', 32_691),
        ('preset = "cmv4000"\nbits = 8', 13_500),
        ('preset = "imx174"\nbits = 8\n[sensor.detector]\nfull_well_e = 10000.0', 10_000),
        ("bits = 12\n[sensor.detector]\nread_noise_e = 3.0", 10_000),
        # what is given of the image's own steps holds
        ('preset = "imx174"\nbits = 8\n[sensor.detector]\ngain_e_per_dn = 10.0\nblack_level_dn = 5.0', 2500),
    ],
)
def test_bits_of_a_scenario_keep_full_scale(tmp_path, section, saturation_e):
    path = tmp_path / "mine.toml"
    path.write_text(
        'schema = "flyaround.recipe"\nversion = 1\ntitle = "mine"\nbase = "eval-black"\n[sensor]\n' + section
    )
    sensor = fa.plan_recipe(path, n=1).scene(0).sensor
    assert sensor.saturation_e == pytest.approx(saturation_e, rel=0.01)


@pytest.mark.parametrize("name", [n for n in fa.list_recipes() if not fa.load_recipe(n).members])
def test_built_in_recipes_deliver_eight_bits(name):
    recipe = fa.load_recipe(name)
    assert recipe.sensor.model(recipe.camera, name).bits == 8
