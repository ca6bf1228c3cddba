"""Folders like SPEED, SPEED+ and SHIRT become data sets: poses copied, labels by the model, mistakes told first."""

import json
import shutil

import cv2
import numpy as np
import pytest

from flyaround.__main__ import run
from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.check.verify import check_dataset
from flyaround.simulator.dataset.formats.native import frame_paths, read_png
from flyaround.simulator.dataset.formats.registry import read_foreign
from flyaround.simulator.dataset.silhouette import silhouette
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.imported import read_label_record
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.pose import Pose

POSES = [((0.6, 0.2, -0.3, 0.71), (0.1, -0.2, 6.0)), ((0.1, 0.9, -0.3, 0.2), (0.9, 0.1, 4.0))]


def _unit(q):
    q = np.array(q) / np.linalg.norm(q)
    return [round(float(v), 9) for v in q]


def write_set(
    folder, *, key="q_vbs2tango_true", labels="test.json", images="images", size=(480, 300), **entry
):
    """A folder in the form of SPEED+'s, its pictures the silhouettes of Tango, and the camera of that size."""
    camera = {
        "Nu": size[0],
        "Nv": size[1],
        "ppx": 5.86e-6,
        "ppy": 5.86e-6,
        "fx": 0.0176,
        "fy": 0.0176,
        "ccx": size[0] / 2,
        "ccy": size[1] / 2,
        "cameraMatrix": [[747, 0, size[0] / 2], [0, 747, size[1] / 2], [0, 0, 1]],
        "distCoeffs": [-0.22383, 0.514098, -0.000665, -0.000214, -0.131243],
    }
    (folder / images).mkdir(parents=True)
    (folder / "camera.json").write_text(json.dumps(camera))
    lens, tango = load_camera(folder / "camera.json"), load_target("tango@low")
    rows = []
    for k, (q, t) in enumerate(POSES, start=1):
        row = {"filename": f"img{k:06d}.jpg", key: _unit(q), "r_Vo2To_vbs_true": list(t), **entry}
        rows.append(row)
        seen = silhouette(lens, Pose.from_arrays("camera", "target", q, t), tango).mask
        cv2.imwrite(str(folder / images / row["filename"]), seen // 2 + 40)
    (folder / labels).write_text(json.dumps(rows))
    return folder


@pytest.fixture
def lightbox(tmp_path):
    return write_set(tmp_path / "lightbox")


def test_a_folder_like_speedplus_becomes_a_data_set(lightbox, tmp_path, capsys):
    out = tmp_path / "out"
    assert run(["convert", str(lightbox), "-o", str(out), "--target", "tango@low"]) == 0
    assert "2 frames of lightbox/test.json (speedplus, tango@low)" in capsys.readouterr().out
    card = read_card(out)
    assert card.complete
    assert card.scenario == {
        "schema": "flyaround.imported",
        "format": "speedplus",
        "source": "lightbox/test.json",
    }
    assert card.camera == load_camera(lightbox / "camera.json")
    for k, (q, t) in enumerate(POSES):
        truth = read_label_record(frame_paths(out, k).truth)
        np.testing.assert_allclose(truth.q_camera_from_target_wxyz, q / np.linalg.norm(q), atol=1e-8)
        assert truth.t_camera_from_target_m == t
        image, mask = read_png(frame_paths(out, k).image), read_png(frame_paths(out, k).mask)
        assert image.ndim == 2
        # the mask lies where the picture shows the craft
        assert np.mean((image > 100) == (mask > 0)) > 0.995
        states = {p.state for p in truth.keypoints}
        assert states <= {"visible", "self_occluded", "out_of_frame"}
        assert len(states) > 1
    assert check_dataset(out).faults == ()


def test_an_imported_set_is_evaluated(lightbox, tmp_path):
    out, report = tmp_path / "out", tmp_path / "report"
    assert run(["convert", str(lightbox / "test.json"), "-o", str(out), "--target", "tango@low"]) == 0
    assert run(["evaluate", str(out), "-o", str(report), "--method", "svd-2018"]) == 0
    metrics = json.loads((report / "metrics.json").read_text())
    assert (metrics["n"], metrics["n_feasible"]) == (2, 1)  # of the second a part is outside
    assert "imported" in str(read_card(out).scenario)
    # it is no scene, and those who need one are told
    with pytest.raises(UserError, match="imported image, which has no scene"):
        read_truth(frame_paths(out, 0).truth)


def test_speed_and_shirt_have_their_own_places(tmp_path):
    write_set(tmp_path / "speed", key="q_vbs2tango", labels="train.json", images="images/train")
    found, form = read_foreign(tmp_path / "speed")
    assert (form, found.default_camera, len(found.pictures)) == ("speed", "speed", 2)
    roe1 = write_set(tmp_path / "shirtv1" / "roe1", labels="roe1.json", images="lightbox/images")
    shutil.copytree(roe1 / "lightbox", roe1 / "synthetic")
    found, form = read_foreign(roe1 / "synthetic")
    assert form == "shirt"
    assert [p.t_s for p in found.pictures] == [0.0, 5.0]
    assert found.pictures[0].path.parent.parent.name == "synthetic"
    with pytest.raises(UserError, match="lightbox and synthetic; give one"):
        read_foreign(roe1)


def test_what_is_wrong_in_a_foreign_set_is_told_and_nothing_is_written(lightbox, tmp_path, capsys):
    out = tmp_path / "out"
    labels = lightbox / "test.json"
    rows = json.loads(labels.read_text())

    def told(new=None, *options):
        if new is not None:
            labels.write_text(json.dumps(new))
        assert run(["convert", str(lightbox), "-o", str(out), *options]) == 2
        assert not out.exists()
        return capsys.readouterr().err

    assert "has no poses (the public test lists have none)" in told([{"filename": "img000001.jpg"}])
    assert "entry 2 has no q_vbs2tango_true" in told([rows[0], {"filename": "img000002.jpg"}])
    assert "4 finite numbers" in told([rows[0] | {"q_vbs2tango_true": [1, 0, 0]}])
    assert "finite numbers" in told([rows[0] | {"r_Vo2To_vbs_true": [0, 0, 10**400]}])
    assert "finite numbers" in told([rows[0] | {"r_Vo2To_vbs_true": {"x": 1}}])
    assert "file name is needed" in told([rows[0] | {"filename": 7}])
    labels.write_text("[" * 100_000)
    assert "nests more than 64 brackets" in told()
    assert "length is 2" in told([rows[0] | {"q_vbs2tango_true": [2, 0, 0, 0]}])
    assert "not in front of the camera" in told([rows[0] | {"r_Vo2To_vbs_true": [0, 0, -5]}])
    assert "is not in" in told([rows[0] | {"filename": "none.jpg"}])
    assert "not within" in told([rows[0] | {"filename": "../../etc/passwd"}])
    labels.write_text("[")
    assert "is not JSON" in told()
    assert "480 x 300 pixels, camera speedplus 1920 x 1200" in told(rows, "--camera", "speedplus")
    second = lightbox / "images" / "img000002.jpg"
    grey = cv2.imread(str(second))
    cv2.imwrite(str(second), grey // np.array([1, 2, 3], np.uint8))
    assert "img000002.jpg is in colour and camera speedplus expects grey ones" in told(rows)
    cv2.imwrite(str(second), grey)
    assert "unknown data-set format 'sped': did you mean speed" in told(None, "--from", "sped")
    (lightbox / "train.json").write_text(json.dumps(rows))
    assert "several sets" in told()
    empty = tmp_path / "empty"
    empty.mkdir()
    assert run(["convert", str(empty), "-o", str(out)]) == 2
    assert "holds no data set in a readable format" in capsys.readouterr().err


def test_evaluate_says_how_to_take_a_foreign_folder(lightbox, tmp_path, capsys):
    assert run(["evaluate", str(lightbox), "-o", str(tmp_path / "report")]) == 2
    assert "flyaround convert" in capsys.readouterr().err


def test_colour_and_grey_pictures_stay_what_they_are(lightbox):
    path = lightbox / "images" / "img000001.jpg"
    from flyaround.simulator.dataset.importing import read_picture

    assert read_picture(path).ndim == 2
    grey = cv2.imread(str(path))
    png = path.with_suffix(".png")
    cv2.imwrite(str(png), grey)  # three bands alike
    assert read_picture(png).ndim == 2
    grey[5, 7] = (1, 2, 3)
    cv2.imwrite(str(png), grey)
    assert read_picture(png)[5, 7].tolist() == [3, 2, 1]
    cv2.imwrite(str(png), grey.astype(np.uint16) * 16)
    assert read_picture(png).dtype == np.uint16


@pytest.mark.parametrize("pose", POSES)
def test_the_silhouette_is_the_one_that_checks_fill(pose):
    """Inside it everything surely covered, outside nothing that is not touched."""
    from flyaround.simulator.dataset.check.geometry import filled_silhouette
    from flyaround.simulator.targets.joined_mesh import joined_mesh

    camera, target = load_camera("speed"), load_target("tango@low")
    at = Pose.from_arrays("camera", "target", *pose)
    seen = silhouette(camera, at, target)
    mesh = joined_mesh(target)
    corners = camera.project(at.apply(mesh.positions_m))[mesh.triangles]
    inner, outer = filled_silhouette(corners, seen.mask.shape)
    assert not ((inner > 0) & (seen.mask == 0)).any()
    assert not ((seen.mask > 0) & (outer == 0)).any()


def test_what_lies_outside_is_counted():
    camera, target = load_camera("speed"), load_target("tango@low")
    half = silhouette(camera, Pose.from_arrays("camera", "target", (1, 0, 0, 0), (-2.0, 0, 6.0)), target)
    assert 0.3 < half.inside < 0.7
    assert (
        silhouette(camera, Pose.from_arrays("camera", "target", (1, 0, 0, 0), (9.0, 0, 6.0)), target).inside
        == 0
    )
    behind = silhouette(camera, Pose.from_arrays("camera", "target", (1, 0, 0, 0), (0, 0, 0.01)), target)
    assert behind.box_amodal_px is None
    assert not behind.mask.any()


def test_spark_and_urso_lists_of_others(tmp_path, capsys):
    """What is wrong in a CSV is told with its line; a pipe is not waited for."""
    import os

    out = tmp_path / "out"
    folder = tmp_path / "spark"
    folder.mkdir()
    os.mkfifo(folder / "a.csv")
    path = folder / "train.csv"
    head = "sequence,filename,Tx,Ty,Tz,Qx,Qy,Qz,Qw\n"

    def told(text, *options):
        path.write_text(text)
        assert run(["convert", str(folder), "-o", str(out), *options]) == 2
        assert not out.exists()
        return capsys.readouterr().err

    assert "train.csv line 2: the position is" in told(head + "1,a.png,0,zero,5,0,0,0,1\n")
    assert "lists no picture" in told(head)
    assert "names a.png, which is not in" in told(head + "../x,a.png,0,0,5,0,0,0,1\n")
    cv2.imwrite(str(folder / "a.png"), np.zeros((30, 48), np.uint8))
    assert "does not name its target; name it with --target" in told(head + "1,a.png,0,0,5,0,0,0,1\n")
    row = head + "1,a.png,0,0,5,0,0,0,1\n"
    assert "no camera.json; name the camera" in told(row, "--target", "tango@low")
    path.unlink()
    (folder / "train_poses_gt.csv").write_text("x,y,z,q1,q2,q3\n")
    assert run(["convert", str(folder), "-o", str(out)]) == 2
    assert "lacks the column q4" in capsys.readouterr().err
    (folder / "train_poses_gt.csv").write_text("x,y,z,q1,q2,q3,q4\n5,0,0,0,0,0,1\n")
    (folder / "train_images.csv").write_text("a.png\nb.png\n")
    assert run(["convert", str(folder), "-o", str(out)]) == 2
    assert "has 1 poses and train_images.csv 2 pictures" in capsys.readouterr().err
