"""The comparison with pictures of others: its figures against known pictures, and our own pictures as the others."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from flyaround.cli.app import app
from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.compare.comparison import compare_pictures
from flyaround.simulator.compare.image_statistics import (
    binary_edges,
    edge_threshold,
    histogram_distance_dn,
    image_statistics,
    noise_dn,
    sobel,
)
from flyaround.simulator.compare.page import write_comparison
from flyaround.simulator.compare.references import read_references, read_speed_labels, resize_camera
from flyaround.simulator.dataset.single_frames import save_picture
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import take_frame
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.targets.library import load_target


def test_the_gradient_of_a_plane_is_its_slope():
    y, x = np.mgrid[0:60, 0:60]
    plane = (x + 2 * y).astype(np.uint8)
    assert np.allclose(sobel(plane)[2:-2, 2:-2], np.hypot(1, 2), atol=1e-4)


def test_gradients_of_diagonal_stripes_are_all_counted():
    y, x = np.mgrid[0:64, 0:64]
    stripes = np.where((x + y) // 4 % 2, 255, 0).astype(np.uint8)
    assert sobel(stripes).max() > 128
    assert image_statistics(stripes).gradient_histogram.sum() == pytest.approx(1.0)


def test_a_small_image_has_noise():
    assert noise_dn(np.random.default_rng(5).integers(90, 110, (12, 40)).astype(np.uint8)) > 1


def test_the_noise_of_a_noisy_plane_is_found_beside_an_edge():
    rng = np.random.default_rng(3)
    scene = np.full((256, 256), 60.0)
    scene[:, 140:] = 180.0
    noisy = np.clip(scene + rng.normal(0, 7.0, scene.shape), 0, 255).round().astype(np.uint8)
    assert noise_dn(noisy) == pytest.approx(7.0, rel=0.05)


def test_a_histogram_moved_by_ten_is_ten_away():
    image = np.random.default_rng(1).integers(20, 90, (64, 64)).astype(np.uint8)
    assert histogram_distance_dn(
        image_statistics(image).histogram, image_statistics(image + 10).histogram, 256.0
    ) == pytest.approx(10.0)


def test_a_square_has_edges_where_its_sides_are():
    image = np.zeros((100, 100), np.uint8)
    image[30:70, 30:70] = 200
    edges = binary_edges(image, edge_threshold(image))
    assert edges[50, 28:32].any()
    assert edges[28:32, 50].any()
    assert not edges[40:60, 40:60].any()
    assert not edges[:20].any()
    assert image_statistics(image).space


@pytest.fixture(scope="module")
def compared(renderer, tmp_path_factory):
    """Two of our own pictures with their records, one before space and one before the Earth, as the others'."""
    folder, page = tmp_path_factory.mktemp("pictures"), tmp_path_factory.mktemp("page")
    for recipe in ("eval-black", "eval-earth"):
        plan = plan_recipe(recipe, 2, seed=1)
        plan = replace(plan, camera=resize_camera(plan.camera, 288, 180))
        save_picture(take_frame(renderer, plan.scene(1), plan.target), folder / f"{recipe}.png")
    references = read_references(folder, load_camera("speed"), 2)
    pairs = compare_pictures(renderer, references, load_target("tango"), lambda _: None)
    write_comparison(page, pairs, "our own")
    return pairs, page


def test_our_own_pictures_are_like_ours(compared):
    (black, earth), _ = compared
    assert [p.reference.path.name for p in (black, earth)] == ["eval-black.png", "eval-earth.png"]
    # the pose is the record's; light and sky are found
    assert black.same_view
    assert earth.same_view
    assert black.likeness is not None
    assert black.likeness > 0.6
    assert black.theirs.space
    assert not earth.theirs.space
    assert black.histogram_moved_dn < 8
    assert earth.histogram_moved_dn < 20
    assert black.ours.noise_dn == pytest.approx(black.theirs.noise_dn, rel=0.1)


def test_air_takes_edges_from_the_ground(compared):
    (_, earth), _ = compared
    share = {name: edges.mean() for name, edges in earth.edges.items()}
    assert list(share) == ["100 km", "25 km", "none"]
    assert share["none"] > 1.5 * share["100 km"] > 0


def test_the_page_shows_its_pictures(compared):
    pairs, page = compared
    text = (page / "index.html").read_text()
    shown = sorted(p.name for p in (page / "pictures").iterdir())
    assert len(shown) == sum(2 * 2 + 1 + len(p.edges) for p in pairs)
    assert all(f"pictures/{name}" in text for name in shown)
    document = json.loads((page / "comparison.json").read_text())
    assert document["summary"]["earth"]["reference"]["mean_dn"] == pytest.approx(
        pairs[1].reference.image.mean(), abs=1e-4
    )


def test_speed_labels_are_read_and_wrong_ones_refused(tmp_path):
    row = {"filename": "a.jpg", "q_vbs2tango": [1, 0, 0, 0], "r_Vo2To_vbs_true": [0, 0.1, 5]}
    good = tmp_path / "train.json"
    good.write_text(json.dumps([row]))
    assert read_speed_labels(good)["a.jpg"].t_m == (0.0, 0.1, 5.0)
    good.write_text(json.dumps([{"filename": "a.jpg"}]))
    with pytest.raises(UserError, match="r_Vo2To_vbs_true"):
        read_speed_labels(good)


@pytest.mark.parametrize("shape", [(1, 10_000), (10_000, 70), (15, 15)])
def test_a_picture_as_narrow_as_a_line_is_refused(shape, tmp_path):
    cv2.imwrite(str(tmp_path / "line.png"), np.zeros(shape, np.uint8))
    with pytest.raises(UserError, match=r"line.png is \d+ x \d+ pixels"):
        read_references(tmp_path, load_camera("speed"), 1)


def test_a_folder_without_pictures_is_refused(tmp_path):
    for place in (tmp_path, tmp_path / "nowhere"):
        result = CliRunner().invoke(app, ["compare", "--reference", str(place), "-o", str(tmp_path / "out")])
        assert isinstance(result.exception, UserError)
    with pytest.raises(UserError, match="no picture"):
        read_references(tmp_path, load_camera("speed"), 4)
