"""Capture, check, resume, exports: a data set from its files alone, and every kind of wrong label caught."""

import dataclasses
import json
import shutil
from types import SimpleNamespace

import cv2
import jsonschema
import msgspec
import numpy as np
import pytest
from small_flight import small_flight

from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.card import DatasetCard
from flyaround.simulator.dataset.check.verify import check_dataset
from flyaround.simulator.dataset.formats.native import frame_paths, read_png
from flyaround.simulator.dataset.single_frames import render_scene, save_picture
from flyaround.simulator.dataset.storage.store import FolderStore
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import take_frame
from flyaround.simulator.labels.truth import Truth, read_truth
from flyaround.simulator.recipes.plan import plan_recipe
from tools.validation.labels.faults import inject_fault

pytestmark = pytest.mark.gl

N = 3


@pytest.fixture(scope="module")
def plan():
    return small_flight(384, n=N)


@pytest.fixture(scope="module")
def dataset(plan, tmp_path_factory):
    folder = tmp_path_factory.mktemp("data") / "set"
    summary = capture(plan, folder, formats=("native", "speed"))
    assert summary.n_written == N
    assert summary.quarantined == ()
    return folder


@pytest.fixture
def copy(dataset, tmp_path):
    return shutil.copytree(dataset, tmp_path / "copy")


def _faults(folder):
    return [fault.what for fault in check_dataset(folder, redraw=0).faults]


def test_card_and_truth_follow_their_schemas(dataset):
    jsonschema.validate(json.loads((dataset / "dataset.json").read_text()), msgspec.json.schema(DatasetCard))
    for k in range(N):
        jsonschema.validate(json.loads(frame_paths(dataset, k).truth.read_text()), msgspec.json.schema(Truth))


def _edit_truth(folder, k, change):
    path = frame_paths(folder, k).truth
    record = json.loads(path.read_text())
    change(record)
    path.write_text(json.dumps(record))


def _set(key, value):
    return lambda record: record.__setitem__(key, value)


def _shift_pixel(record):
    record["keypoints"][2]["pixel_px"][0] += 0.01


def _shift_translation(record):
    record["t_camera_from_target_m"][0] += 1e-3


def _conjugate(record):
    q = record["q_camera_from_target_wxyz"]
    record["q_camera_from_target_wxyz"] = [q[0], -q[1], -q[2], -q[3]]


def _consistent_wrong_pose(record):
    """A pose wrong everywhere in the record at once: only the picture's mask can tell."""
    record["t_camera_from_target_m"][0] += 0.05
    record["scene"]["t_camera_from_target_m"] = record["t_camera_from_target_m"]
    truth_q = np.array(record["q_camera_from_target_wxyz"])
    from flyaround.simulator.world.frames.rotation import matrix_from_quat

    c = record["camera"]
    for k in record["keypoints"]:
        x, y, z = matrix_from_quat(truth_q) @ k["target_m"] + record["t_camera_from_target_m"]
        k["pixel_px"] = [c["fx_px"] * x / z + c["cx_px"], c["fy_px"] * y / z + c["cy_px"]]


def _out_of_frame(record):
    record["keypoints"][0]["state"] = "out_of_frame"


def _swap_names(record):
    a, b = record["keypoints"][0], record["keypoints"][1]
    a["name"], b["name"] = b["name"], a["name"]


def _see_through(record):
    for k in record["keypoints"]:
        if k["state"] == "self_occluded":
            k["state"] = "visible"


def _other_scene_camera(record):
    record["scene"]["camera"]["fx_px"] = 1000.0


@pytest.mark.parametrize(
    "change",
    [
        _see_through,
        _other_scene_camera,
        lambda r: r.update(feasible=not r["feasible"], infeasible_reason="dark" if r["feasible"] else ""),
        _set("box_amodal_px", [0.0, 0.0, 1.0, 1.0]),
        _set("epoch_utc", "2020-01-01T00:00:00Z"),
        _set("t_s", 12345.0),
        _set("seed", 99),
        _set("frame_index", 0),
        _shift_pixel,
        _shift_translation,
        _conjugate,
        _consistent_wrong_pose,
        _out_of_frame,
        _swap_names,
        _set("box_px", [0.5, 0.5, 10.5, 10.5]),
        _set("sun_direction_camera", [0.0, 0.0, 1.0]),
        _set("q_camera_from_target_wxyz", [0.9, 0.1, 0.1, 0.1]),
    ],
)
def test_each_kind_of_wrong_record_is_caught(copy, change):
    _edit_truth(copy, 1, change)
    assert _faults(copy)


def _shift_mask(mask):
    return np.roll(mask, 3, axis=1)


def _hole(mask):
    rows, columns = np.nonzero(mask)
    out = mask.copy()
    v, u = int(np.median(rows)), int(np.median(columns))
    inside = cv2.erode(mask, np.ones((9, 9), np.uint8))
    rows, columns = np.nonzero(inside)
    v, u = rows[len(rows) // 2], columns[len(rows) // 2]
    out[v - 1 : v + 2, u - 1 : u + 2] = 0
    return out


def _grey(mask):
    return np.where(mask > 0, np.uint8(254), mask)


@pytest.mark.parametrize("change", [_shift_mask, _hole, _grey])
def test_each_kind_of_wrong_mask_is_caught(copy, change):
    path = frame_paths(copy, 0).mask
    cv2.imwrite(str(path), change(np.asarray(read_png(path), np.uint8)))
    assert _faults(copy)


def test_missing_damaged_and_resized_files_are_caught(copy):
    frame_paths(copy, 0).mask.unlink()
    frame_paths(copy, 1).image.write_bytes(b"not a PNG")
    image = read_png(frame_paths(copy, 2).image)
    cv2.imwrite(str(frame_paths(copy, 2).image), image[:-1])
    faults = check_dataset(copy, redraw=0).faults
    assert {fault.frame for fault in faults} == {0, 1, 2, None}
    assert any("manifest.sha256 lists frame 0, which is missing" in fault.what for fault in faults)


def test_another_picture_in_its_place_is_caught(copy):
    frame_paths(copy, 0).image.write_bytes(frame_paths(copy, 2).image.read_bytes())
    assert any("image is not the one" in what for what in _faults(copy))


def test_a_damaged_record_does_not_cost_the_report(copy):
    path = frame_paths(copy, 0).truth
    path.write_bytes(path.read_bytes()[:500])
    report = check_dataset(copy, redraw=0)
    assert {fault.frame for fault in report.faults} == {0}


def _flip_a_bit(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


@pytest.mark.parametrize("with_manifest", [True, False])
def test_resume_draws_again_what_is_damaged(copy, dataset, plan, with_manifest):
    _flip_a_bit(frame_paths(copy, 0).image)
    frame_paths(copy, 2).mask.unlink()
    (copy / "images" / ".000001.png.77.abcd.part").write_bytes(b"left by a killed one")
    if not with_manifest:  # as of an earlier version, or with lines that a loss of power cost
        (copy / "manifest.sha256").unlink()
    summary = capture(plan, copy, resume=True)
    assert (summary.damaged, summary.n_written, summary.n_kept) == ((0, 2), 2, 1)
    names = sorted(path.relative_to(dataset) for path in (dataset / "images").iterdir())
    assert sorted(path.relative_to(copy) for path in (copy / "images").iterdir()) == names
    assert all((copy / name).read_bytes() == (dataset / name).read_bytes() for name in names)
    assert (copy / "manifest.sha256").read_bytes() == (dataset / "manifest.sha256").read_bytes()


def test_a_frame_that_has_its_name_is_in_the_manifest_whenever_the_process_is_killed(copy, plan, monkeypatch):
    """As killed between any two steps of writing a batch."""
    whole = {path.relative_to(copy): path.read_bytes() for path in copy.rglob("*") if path.is_file()}
    shutil.rmtree(copy)
    real = FolderStore.write

    def write_and_die(self, *waves):
        real(self, *waves)
        if len(waves) > 1:
            raise Killed

    class Killed(BaseException):
        pass

    monkeypatch.setattr(FolderStore, "write", write_and_die)
    with pytest.raises(Killed):
        capture(plan, copy, formats=("native", "speed"))
    monkeypatch.undo()
    names = {path.relative_to(copy).as_posix() for path in (copy / "images").glob("??????.*")}
    assert names
    listed = {line.split()[1] for line in (copy / "manifest.sha256").read_text().splitlines()}
    assert names <= listed
    capture(plan, copy, resume=True, formats=("native", "speed"))
    assert {path.relative_to(copy): path.read_bytes() for path in copy.rglob("*") if path.is_file()} == whole


def test_resume_takes_more_samples_of_a_recipe_and_not_fewer(tmp_path):
    def recipe(n):
        made = plan_recipe("eval-black", n, target="tango@low", quality="draft")
        return dataclasses.replace(made, camera=made.camera.resized(384))

    capture(recipe(1), tmp_path / "grown")
    summary = capture(recipe(2), tmp_path / "grown", resume=True)
    assert (summary.n_written, summary.n_kept) == (1, 1)
    capture(recipe(2), tmp_path / "whole")
    for path in sorted((tmp_path / "whole").rglob("*.*")):
        if path.is_file():
            assert (
                tmp_path / "grown" / path.relative_to(tmp_path / "whole")
            ).read_bytes() == path.read_bytes()
    with pytest.raises(UserError, match="data set of 2 frames, and 1 are requested"):
        capture(recipe(1), tmp_path / "grown", resume=True)


def test_more_moments_of_a_flight_are_other_moments(copy):
    before = {path: path.read_bytes() for path in copy.rglob("*") if path.is_file()}
    with pytest.raises(UserError, match="frames would have other times"):
        capture(small_flight(384, n=N + 1), copy, resume=True)
    assert {path: path.read_bytes() for path in copy.rglob("*") if path.is_file()} == before


def test_too_little_room_is_refused_before_anything_is_drawn(tmp_path, plan, monkeypatch):
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=1000))
    with pytest.raises(UserError, match=r"3 frames take about .* MB and the disk of .* has 0\.0 MB left"):
        capture(plan, tmp_path / "set")
    assert list(tmp_path.iterdir()) == []


def test_resume_refuses_another_plan(copy):
    with pytest.raises(UserError, match="another seed"):
        capture(small_flight(384, n=N, seed=99), copy, resume=True)


def test_resume_refuses_other_labels_and_leaves_what_is_there(copy, plan):
    card, names = (copy / "dataset.json").read_bytes(), sorted(p.name for p in (copy / "images").iterdir())
    frame_paths(copy, 1).truth.unlink()
    # half a data set with depth and half without would be neither
    with pytest.raises(UserError, match=r"other labels \(none, here depth\)"):
        capture(plan, copy, labels=("depth",), resume=True)
    assert (copy / "dataset.json").read_bytes() == card
    assert sorted(p.name for p in (copy / "images").iterdir()) == [n for n in names if n != "000001.json"]


def test_resume_keeps_the_formats_and_needs_a_card(copy, plan, tmp_path):
    capture(plan, copy, resume=True)
    assert json.loads((copy / "dataset.json").read_text())["formats"] == ["native", "speed"]
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "mine.txt").write_text("keep")
    with pytest.raises(UserError, match=r"no dataset\.json"):
        capture(plan, tmp_path / "other", resume=True)
    assert [p.name for p in (tmp_path / "other").iterdir()] == ["mine.txt"]


def test_an_interrupted_capture_is_valid_as_far_as_it_went(tmp_path, plan):
    folder = tmp_path / "set"

    def stop(done, _of):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        capture(plan, folder, progress=stop)
    report = check_dataset(folder, redraw=0)
    assert (report.n_frames, report.faults) == (2, ())
    assert not json.loads((folder / "dataset.json").read_text())["complete"]


def test_a_frame_whose_labels_disagree_is_kept_apart_and_named_in_the_card(tmp_path, plan, monkeypatch):
    """A mask that is drawn four pixels off in one frame: the picture goes to quarantine, resuming mends it."""
    import flyaround.simulator.loop as drawing

    def careless(renderer, scene, target, *, labels):
        frame = take_frame(renderer, scene, target, labels=labels)
        return frame if scene.frame_index != 1 else inject_fault("mask moved", frame)

    monkeypatch.setattr(drawing, "take_frame", careless)
    folder = tmp_path / "set"
    summary = capture(plan, folder)
    ((frame, reason),) = summary.quarantined
    assert frame == 1
    assert "mask is not the mesh's" in reason or "mask differs from the projected craft" in reason
    card = json.loads((folder / "dataset.json").read_text())
    jsonschema.validate(card, msgspec.json.schema(DatasetCard))
    assert card["quarantined"] == [{"frame": 1, "reason": reason}]
    assert not card["complete"]
    assert not frame_paths(folder, 1).image.exists()
    assert frame_paths(folder / "quarantine", 1).image.exists()
    assert (folder / "quarantine" / "000001.txt").read_text() == reason + "\n"
    assert check_dataset(folder, redraw=0).faults == ()
    monkeypatch.undo()
    capture(plan, folder, resume=True)
    card = json.loads((folder / "dataset.json").read_text())
    assert (card["quarantined"], card["complete"]) == ([], True)
    assert check_dataset(folder, redraw=0).faults == ()


def test_from_truth_gives_the_same_bytes(tmp_path, dataset, plan):
    paths = frame_paths(dataset, 2)
    frame = render_scene(read_truth(paths.truth).scene, plan.target)
    truth_path = save_picture(frame, tmp_path / "again.png")
    assert (tmp_path / "again.png").read_bytes() == paths.image.read_bytes()
    assert truth_path.read_bytes() == paths.truth.read_bytes()
    assert np.array_equal(frame.mask, read_png(paths.mask))


def test_exr_keeps_the_radiance_and_npy_the_numbers(tmp_path, plan):
    import OpenEXR

    frame = render_scene(plan.scene(0), plan.target)
    save_picture(frame, tmp_path / "a.exr")
    save_picture(frame, tmp_path / "a.npy")
    back = OpenEXR.File(str(tmp_path / "a.exr")).channels()["Y"].pixels
    assert np.array_equal(back, frame.radiance)
    assert np.array_equal(np.load(tmp_path / "a.npy"), frame.image)
    with pytest.raises(UserError, match="end the name"):
        save_picture(frame, tmp_path / "a.tiff")
