"""The label layers of one small captured pair of frames: right as captured, and every corruption of each caught."""

import json
import shutil
from dataclasses import replace
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from small_flight import small_flight

from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.check.verify import check_dataset, check_frame
from flyaround.simulator.dataset.formats.native import frame_paths, layer_path, read_layer, read_png
from flyaround.simulator.dataset.single_frames import render_scene, save_picture
from flyaround.simulator.labels.layers import layer_hash
from flyaround.simulator.labels.request import LAYERS, LabelRequest, parse_labels
from flyaround.simulator.labels.truth import Truth, read_truth

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def plan():
    plan = small_flight(256, times=(20.0, 20.5))
    camera = plan.camera
    # longer, and to the side, so that the craft is cropped
    return replace(
        plan, camera=replace(camera, fx_px=camera.fx_px * 1.6, fy_px=camera.fy_px * 1.45, cx_px=12.0)
    )


@pytest.fixture(scope="module")
def dataset(plan, tmp_path_factory):
    folder = tmp_path_factory.mktemp("layers") / "set"
    summary = capture(plan, folder, labels=LAYERS)
    assert summary.quarantined == ()
    return folder


def test_all_layers_are_there_and_right(dataset, plan):
    report = check_dataset(dataset, redraw=0)
    assert report.faults == ()
    truth = read_truth(frame_paths(dataset, 0).truth)
    assert truth.layers == LAYERS
    assert set(truth.layer_sha256) == set(LAYERS) - {"wireframe"}
    assert read_truth(frame_paths(dataset, 1).truth).flow is None  # nothing follows the last frame
    assert truth.amodal_origin_px[0] < 0  # the craft is cropped
    assert len(truth.parts) == len(plan.target.parts)
    parts = read_layer(dataset / "images", "000000", "parts")
    assert len(np.unique(parts)) > 8


@pytest.fixture(scope="module")
def captured(dataset, plan):
    """The first frame as read from its files, and how to check a changed copy of it."""
    truth = read_truth(frame_paths(dataset, 0).truth)
    image, mask = (read_png(p) for p in (frame_paths(dataset, 0).image, frame_paths(dataset, 0).mask))
    layers = {name: read_layer(dataset / "images", "000000", name) for name in truth.layer_sha256}
    card = read_card(dataset)

    def check(new_truth=truth, **changed):
        hashes = {
            **new_truth.layer_sha256,
            **{name: layer_hash(name, layer, mask) for name, layer in changed.items()},
        }
        if changed:
            new_truth = msgspec.structs.replace(new_truth, layer_sha256=hashes)
        return check_frame(0, new_truth, image, mask, card, plan.target, {**layers, **changed})

    return SimpleNamespace(truth=truth, image=image, layers=layers, check=check)


def _swap_two_parts(parts):
    (a, b) = np.argsort(-np.bincount(parts.ravel())[1:])[:2] + 1
    out = parts.copy()
    out[parts == a], out[parts == b] = b, a
    return out


def _merge_smallest_part(parts):
    """A part of some twenty pixels is given the number of the largest one."""
    count = np.bincount(parts.ravel())
    count[count < 20] = parts.size
    smallest = int(np.argmin(count))
    out = parts.copy()
    out[parts == smallest] = int(np.argmax(np.bincount(parts.ravel())[1:])) + 1
    return out


def _on(layer, change):
    out = layer.copy()
    where = np.isfinite(layer) & (layer != 0)
    out[where] = change(layer[where])
    return out


def _roll_inside(layer):
    """Every value one pixel to the side, where both pixels are on the craft."""
    valid = np.isfinite(layer) if layer.ndim == 2 else np.abs(np.nan_to_num(layer)).sum(axis=2) > 0
    both = valid & np.roll(valid, 1, axis=1)
    out = layer.copy()
    out[both] = np.roll(layer, 1, axis=1)[both]
    return out


MUTATIONS = [
    ("depth", lambda x: x * np.float32(1.001)),
    ("depth", lambda x: x + np.float32(0.005)),
    ("depth", lambda x: np.sqrt(x**2 + np.float32(0.05))),  # range instead of z, about
    ("depth", _roll_inside),
    ("depth", lambda x: np.roll(x, 1, axis=0)),
    ("depth", np.nan_to_num),
    ("depth", lambda x: -x),
    ("depth", lambda x: x[:, ::-1]),
    ("depth", lambda x: np.where(x == np.nanmin(x), np.float32(np.nan), x)),
    ("depth", lambda x: x.astype(np.float16).astype(np.float32)),
    ("parts", _swap_two_parts),
    ("parts", _merge_smallest_part),
    ("parts", lambda x: _on(x, lambda v: v + 1)),
    ("parts", lambda x: _on(x, lambda v: v + 100)),
    ("parts", lambda x: np.where(x == np.bincount(x.ravel())[1:].argmax() + 1, 0, x).astype(np.uint16)),
    ("parts", lambda x: np.maximum(x, 1)),
    ("normals", lambda x: -x),
    ("normals", lambda x: x * np.float16(0.9)),
    ("normals", lambda x: x[..., [1, 0, 2]]),
    ("normals", lambda x: x * np.array([1, -1, 1], np.float16)),
    ("normals", lambda x: np.where(x == 0, np.float16(0.5), x)),
    ("normals", lambda x: np.where(np.abs(x).sum(axis=2, keepdims=True) > 0, np.float16([0, 0, -1]), x)),
    ("flow", lambda x: -x),
    ("flow", lambda x: x * np.float32(1.01)),
    ("flow", lambda x: x[..., ::-1]),
    ("flow", lambda x: x + np.float32(0.02)),
    ("flow", np.nan_to_num),
    ("flow", lambda x: np.full_like(x, np.nan)),
    ("clean", lambda x: np.roll(x, 4, axis=1)),
    ("clean", np.zeros_like),
    ("clean", lambda x: (x * 0.7).astype(x.dtype)),
    ("clean", lambda x: x[:-1]),
    ("amodal", lambda x: np.roll(x, 2, axis=1)),
    ("amodal", lambda x: x[:, 3:]),
    ("amodal", lambda x: np.where(np.arange(x.shape[1]) < 24, 0, x).astype(np.uint8)),
    ("amodal", lambda x: x // 255),
]


@pytest.mark.parametrize(("name", "change"), MUTATIONS, ids=[f"{n}{k}" for k, (n, _) in enumerate(MUTATIONS)])
def test_each_kind_of_wrong_layer_is_caught(captured, name, change):
    faults = captured.check(**{name: change(captured.layers[name].copy())})
    assert faults, f"a wrong {name} layer passes"
    assert not any("record describes" in what for what in faults)  # not by its hash alone


def test_the_frame_as_captured_is_right(captured):
    assert captured.check() == []


def test_the_noisy_image_is_not_its_own_clean_twin(captured):
    assert any("clean twin" in what for what in captured.check(clean=captured.image))


def test_a_layer_that_is_not_the_record_s_is_caught(captured, dataset, plan):
    layers = {**captured.layers, "depth": captured.layers["depth"] + np.float32(1e-6)}
    mask = read_png(frame_paths(dataset, 0).mask)
    faults = check_frame(0, captured.truth, captured.image, mask, read_card(dataset), plan.target, layers)
    assert faults == ["layer depth is not the one that the record describes"]


def _long_edge(record):
    edges = [w for w in record["wireframe"] if w["visible"]]
    return max(edges, key=lambda w: np.hypot(*np.subtract(*w["ends_px"])))


def _hide_an_edge(record):
    _long_edge(record)["visible"] = []


def _show_all_edges(record):
    for wire in record["wireframe"]:
        wire["visible"] = [[0.0, 1.0]]


@pytest.mark.parametrize(
    "change",
    [
        _hide_an_edge,
        _show_all_edges,
        lambda r: _long_edge(r)["ends_px"][0].__setitem__(0, 3.0),
        lambda r: _long_edge(r).update(visible=[[0.5, 0.2]]),
        lambda r: r["wireframe"].pop(),
        lambda r: r["wireframe"][0].update(name="another"),
        lambda r: r.update(layers=[n for n in r["layers"] if n != "wireframe"]),
        lambda r: r["box_3d_target_m"][0].__setitem__(0, 9.0),
        lambda r: r["box_3d_px"][3].__setitem__(1, 9.0),
        lambda r: r["box_3d_px"].__setitem__(0, None),
        lambda r: r.update(earth_direction_camera=[0.0, 0.0, 1.0]),
        lambda r: r.update(exposure_s=0.5),
        lambda r: r.update(sun_visible_fraction=0.5),
        lambda r: r.update(parts=r["parts"][::-1]),
        lambda r: r.update(parts=r["parts"][:3]),
        lambda r: r.update(layers=["depth"]),
        lambda r: r["layer_sha256"].pop("depth"),
        lambda r: r["flow"]["t_camera_from_target_m"].__setitem__(2, 9.0),
        lambda r: r["flow"].update(q_camera_from_target_wxyz=r["q_camera_from_target_wxyz"]),
        lambda r: r.update(flow=None),
        lambda r: r.update(amodal_origin_px=[0, 0]),
        lambda r: r.update(amodal_origin_px=[1, 1]),
        lambda r: r.update(amodal_origin_px=None),
        lambda r: r.update(
            row_poses=[
                {
                    "row_px": 0,
                    "dt_s": 0.0,
                    "q_camera_from_target_wxyz": r["q_camera_from_target_wxyz"],
                    "t_camera_from_target_m": r["t_camera_from_target_m"],
                }
            ]
        ),
    ],
)
def test_each_kind_of_wrong_record_of_layers_is_caught(captured, change):
    record = json.loads(msgspec.json.encode(captured.truth))
    change(record)
    assert captured.check(msgspec.convert(record, Truth))


def test_flow_to_another_frame_than_the_next_is_caught(dataset, tmp_path):
    folder = shutil.copytree(dataset, tmp_path / "copy")
    path = frame_paths(folder, 0).truth
    record = json.loads(path.read_text())
    record["flow"]["t_s"] += 1.0
    path.write_text(json.dumps(record))
    assert any("optical flow leads" in fault.what for fault in check_dataset(folder, redraw=0).faults)


def test_a_missing_or_damaged_layer_is_caught(dataset, tmp_path):
    folder = shutil.copytree(dataset, tmp_path / "copy")
    layer_path(folder / "images", "000000", "depth").unlink()
    layer_path(folder / "images", "000001", "normals").write_bytes(b"not an EXR")
    assert {f.frame for f in check_dataset(folder, redraw=0).faults} == {0, 1}


def test_the_record_gives_image_truth_and_layers_again(dataset, plan, tmp_path):
    truth = read_truth(frame_paths(dataset, 0).truth)
    frame = render_scene(truth.scene, plan.target, labels=LabelRequest(layers=truth.layers, flow=truth.flow))
    record = save_picture(frame, tmp_path / "000000.png")
    assert record.read_bytes() == frame_paths(dataset, 0).truth.read_bytes()
    for name in truth.layer_sha256:
        ours = layer_path(tmp_path, "000000", name)
        assert ours.read_bytes() == layer_path(dataset / "images", "000000", name).read_bytes()


def test_label_names_are_parsed_in_one_order():
    assert parse_labels("flow, depth") == ("depth", "flow")
    assert parse_labels("all") == LAYERS
    assert parse_labels("none") == ()
    with pytest.raises(Exception, match="unknown label 'deep'"):
        parse_labels("deep")


def test_records_without_the_new_fields_are_still_read(dataset, tmp_path):
    record = json.loads(frame_paths(dataset, 0).truth.read_text())
    for name in (
        "layers",
        "layer_sha256",
        "flow",
        "wireframe",
        "parts",
        "exposure_s",
        "box_3d_px",
        "row_poses",
    ):
        record.pop(name)
    record["scene"].pop("shutter")
    (tmp_path / "old.json").write_text(json.dumps(record))
    assert read_truth(tmp_path / "old.json").layers == ()
    assert msgspec.json.encode(read_truth(tmp_path / "old.json").scene.shutter)
