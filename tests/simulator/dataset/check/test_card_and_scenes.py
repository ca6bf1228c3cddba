"""Faults planted in the card, the manifest, and in record and scene alike."""

import dataclasses
import json
import shutil

import msgspec
import pytest

from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.check.recomputed_scenes import check_scenes
from flyaround.simulator.dataset.check.verify import check_dataset
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

pytestmark = pytest.mark.gl


def small(plan):
    return dataclasses.replace(plan, camera=plan.camera.resized(128))


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    scenario = load_scenario("tango-flyaround")
    c = scenario.camera
    f, size = c.fx_px * 128 / c.width_px, {"width_px": 128, "height_px": 80, "cx_px": 63.5, "cy_px": 39.5}
    camera = msgspec.structs.replace(c, fx_px=f, fy_px=f, **size)
    scenario = msgspec.structs.replace(scenario, target="tango@low", camera=camera)
    folder = tmp_path_factory.mktemp("card") / "set"
    capture(plan_flight(scenario, n=4, quality="draft"), folder, labels=("depth",), split=(2, 1, 1))
    return folder


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    folder = tmp_path_factory.mktemp("card") / "set"
    capture(small(plan_recipe("thesis", 3, target="tango@low", quality="draft")), folder)
    return folder


@pytest.fixture
def copy(flown, tmp_path):
    return shutil.copytree(flown, tmp_path / "set")


def wrong(folder):
    return [(fault.frame, fault.what) for fault in check_dataset(folder, redraw=0).faults]


def edit(path, change):
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))


def without_manifest(folder):
    """Remove what tells of every altered file, so that only the check in question can."""
    (folder / "manifest.sha256").unlink()


@pytest.mark.parametrize("name", ["flown", "drawn"])
def test_fresh_sets_have_no_fault(name, request):
    report = check_dataset(request.getfixturevalue(name), redraw=0)
    assert report.faults == ()
    assert report.not_checked == ()


def test_a_wrong_hash_and_a_missing_line_of_the_manifest_are_found(copy):
    path = copy / "manifest.sha256"
    lines = path.read_text().splitlines()
    lines[0] = "0" * 64 + lines[0][64:]
    path.write_text("\n".join(lines[:-1]) + "\n")
    first, last = lines[0].split()[1], lines[-1].split()[1]
    assert sorted(wrong(copy)) == [
        (0, f"{first} has another hash than in manifest.sha256"),
        (3, f"{last} is not in manifest.sha256"),
    ]


def exchanged(keypoints):
    names = list(keypoints)
    return {name: keypoints[name] for name in [names[1], names[0], *names[2:]]}


CARDS = {
    "order of keypoints": lambda d: d["target"].update(keypoints=exchanged(d["target"]["keypoints"])),
    "place of a keypoint": lambda d: next(iter(d["target"]["keypoints"].values())).__setitem__(0, 9.0),
    "parts": lambda d: d["target"]["parts"].reverse(),
    "classes of parts": lambda d: d["target"]["part_classes"].__setitem__(0, "radiator"),
    "a label too many": lambda d: d["labels"].append("normals"),
    "a label too few": lambda d: d["labels"].clear(),
    "a format that is not there": lambda d: d["formats"].append("coco"),
    "epoch": lambda d: d["scenario"].update(epoch_utc="2015-06-30T00:00:00Z"),
    "orbit": lambda d: d["scenario"]["orbit"].update(
        {
            key: value * 1.001
            for key, value in d["scenario"]["orbit"].items()
            if key in ("perigee_km", "a_km", "altitude_km")
        }
    ),
    "seed": lambda d: d.update(seed=d["seed"] + 1),
    "spacing": lambda d: d.update(every_s=3.0),
    "conventions": lambda d: d["conventions"].update(pose="x_target = R x_camera"),
    "layout": lambda d: d.update(layout="images/NNN.jpg"),
    "no split": lambda d: d.update(split=None),
    "a sensor": lambda d: d.update(sensors=["lidar"]),
    "a frame in quarantine that is not": lambda d: d.update(quarantined=[{"frame": 1, "reason": "dark"}]),
    "fewer frames": lambda d: d.update(n_frames=3),
    "more frames": lambda d: d.update(n_frames=5),
    "name of the scenario": lambda d: d.update(scenario_name="other"),
    "target": lambda d: d["target"].update(name="tango"),
    "target of the scenario": lambda d: d["scenario"].update(target="tango"),
    "hash of the target": lambda d: d["target"].update(sha256="0" * 64),
    "camera": lambda d: d["camera"].update(fx_px=999.0),
    "bits": lambda d: d.update(image_bits=12),
    "a scenario of an unknown kind": lambda d: d["scenario"].update(schema="scenario"),
    "no time": lambda d: d["scenario"].update(epoch_utc="yesterday"),
    "an orbit within the Earth": lambda d: d["scenario"]["orbit"].update(altitude_km=-900.0),
}


@pytest.mark.parametrize("kind", CARDS)
def test_a_card_that_says_something_else_is_found(copy, kind):
    edit(copy / "dataset.json", CARDS[kind])
    assert wrong(copy)


def leaves(document, path=()):
    """Yield the path and value of every number, word, switch and empty list."""
    items = document.items() if isinstance(document, dict) else enumerate(document)
    for key, value in items:
        if isinstance(value, dict | list) and value:
            yield from leaves(value, (*path, key))
        else:
            yield (*path, key), value


def altered(value):
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return value + 1 if isinstance(value, int) else value * 1.01 or 0.01
    return {None: 2, "tango@low": "tango"}.get(value, f"{value}x") if not isinstance(value, list) else ["x"]


WITHOUT_EFFECT = {
    "title": "words",
    "description": "words",
    "camera.name": "a word",
    "camera.notes": "words",
    "seed": "the card's own stands, which a command line may replace",
    "chaser.minimum_start_range_m": "a bound that the start keeps either way",
    "optics.wavelength_nm": "the lens has no aperture that diffracts",
    "optics.kernel_file": "a name: the kernel itself is in the card",
    **{
        f"forces.{craft}.{name}": "there is neither drag nor the Sun's pressure"
        for craft in ("target", "chaser")
        for name in ("mass_kg", "area_m2", "drag_coefficient", "reflectivity")
    },
}
"""Fields of the scenario that change no frame, and so no check can see."""


def test_every_field_of_the_scenario_that_changes_a_frame_is_compared(flown):
    card = read_card(flown)
    scenes = {k: read_truth(flown / "images" / f"{k:06d}.json").scene for k in range(4)}
    unnoticed = set()
    for path, value in leaves(card.scenario):
        document = json.loads(json.dumps(card.scenario))
        place = document
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = altered(value)
        found = check_scenes(msgspec.structs.replace(card, scenario=document), scenes, 1)
        if not (found.faults or found.not_checked):
            unnoticed.add(".".join(map(str, path)))
    assert unnoticed - {"name"} == set(WITHOUT_EFFECT)


STRAYS = {
    "picture": lambda folder: shutil.copy(folder / "images/000001.png", folder / "images/000009.png"),
    "layer": lambda folder: shutil.copy(folder / "images/000001.png", folder / "images/000001.range.png"),
    "record": lambda folder: shutil.copy(folder / "images/000001.json", folder / "images/old.json"),
    "text": lambda folder: (folder / "images/notes.txt").write_text("x"),
}


@pytest.mark.parametrize("kind", STRAYS)
def test_a_file_of_no_frame_is_found(copy, kind):
    STRAYS[kind](copy)
    assert any("is of no frame, label or sensor" in what for _, what in wrong(copy))


def test_a_line_of_the_manifest_for_no_frame_is_found(copy):
    with (copy / "manifest.sha256").open("a") as file:
        file.write(f"{'0' * 64}  images/000099.png\n")
    assert wrong(copy) == [(None, "manifest.sha256 lists frame 99, which is missing")]


def test_a_file_whose_name_is_no_number_is_of_no_frame(copy):
    (copy / "images" / "\N{SUPERSCRIPT TWO}.png").write_bytes(b"")
    assert wrong(copy) == [(None, "images/\N{SUPERSCRIPT TWO}.png is of no frame, label or sensor")]


@pytest.mark.parametrize(("name", "frame"), [("images/000001.json", 1), ("dataset.json", None)])
def test_a_key_that_is_there_twice_is_found(copy, name, frame):
    without_manifest(copy)
    text = (copy / name).read_text()
    (copy / name).write_text(text.replace("{", '{"seed": 99,', 1))
    assert [k for k, what in wrong(copy) if "key 'seed' occurs twice" in what] == [frame]


SPLITS = {
    "a frame twice": lambda d: d["test"].append(d["train"][0]),
    "a frame too few": lambda d: d["train"].pop(),
    "a frame that is not there": lambda d: d["test"].append(99),
    "lists exchanged": lambda d: d.update(test=d["validation"], validation=d["test"]),
}


@pytest.mark.parametrize("kind", SPLITS)
def test_a_split_that_is_none_of_the_frames_is_found(copy, kind):
    edit(copy / "split.json", SPLITS[kind])
    assert [what for frame, what in wrong(copy) if frame is None and "split.json" in what]


def both(name, change):
    def spoil(record):
        if name in record:
            record[name] = change(record[name])
        record["scene"][name] = change(record["scene"][name])

    return spoil


RECORDS = {
    "epoch": both("epoch_utc", lambda text: f"{int(text[:4]) + 1}{text[4:]}"),
    "rate of the target": both("omega_target_rad_s", lambda w: [x * 1.01 for x in w]),
    "rate of the camera": both("omega_camera_rad_s", lambda w: [x + 1e-6 for x in w]),
    "relative velocity": both("v_target_camera_m_s", lambda v: [x + 1e-4 for x in v]),
    "ECI velocity of the target": both("v_target_eci_m_s", lambda v: [-x for x in v]),
    "ECI velocity of the camera": both("v_camera_eci_m_s", lambda v: [x * 1.0001 for x in v]),
    "ECI position of the camera": both("r_camera_eci_m", lambda r: [x + 10 for x in r]),
    "Earth's orientation": both("q_itrs_from_eci_wxyz", lambda q: [q[1], q[0], q[2], q[3]]),
    "Moon's orientation": both("q_moon_from_eci_wxyz", lambda q: [q[0], -q[1], q[2], q[3]]),
    "Moon's position": both("r_moon_eci_m", lambda r: [x * 1.0001 for x in r]),
    "stars": both("environment", lambda e: e | {"stars": not e["stars"]}),
    "time": both("t_s", lambda t: t + 1e-3),
}


@pytest.mark.parametrize("kind", RECORDS)
@pytest.mark.parametrize("name", ["flown", "drawn"])
def test_a_record_altered_together_with_its_scene_is_found(name, kind, request, tmp_path):
    folder = shutil.copytree(request.getfixturevalue(name), tmp_path / "set")
    without_manifest(folder)
    edit(folder / "images" / "000001.json", RECORDS[kind])
    found = [what for frame, what in wrong(folder) if frame == 1]
    before = json.loads((request.getfixturevalue(name) / "images" / "000001.json").read_text())
    after = json.loads((folder / "images" / "000001.json").read_text())
    if name == "drawn" and before == after:
        pytest.skip("a recipe's craft does not move")
    assert any("scene is not that of the card's scenario" in what for what in found)


def test_order_of_keypoints_in_a_record_is_found(copy):
    without_manifest(copy)
    edit(copy / "images" / "000002.json", lambda d: d["keypoints"].reverse())
    assert wrong(copy) == [(2, "keypoints are in another order than the card's")]


def test_scenes_of_another_version_are_said_not_to_be_computed_again(copy):
    edit(copy / "dataset.json", lambda d: d["machine"].update(flyaround="0.0.1"))
    report = check_dataset(copy, redraw=0)
    assert report.faults == ()
    assert any("flyaround 0.0.1" in reason for reason in report.not_checked)
