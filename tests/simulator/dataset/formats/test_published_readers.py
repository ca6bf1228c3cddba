"""Formats read by the libraries that people use: pycocotools, webdataset, datasets; see `make test-formats`."""

import io
import json

import numpy as np
import pytest

import flyaround as fa

pytestmark = [pytest.mark.gl, pytest.mark.slow, pytest.mark.filterwarnings("ignore::DeprecationWarning")]

SPLITS = ("train", "validation", "test")


@pytest.fixture(scope="module")
def frames(everything):
    return {frame.number: frame for frame in fa.open_dataset(everything)}


def test_coco_by_pycocotools(everything, frames, capsys):
    coco_module = pytest.importorskip("pycocotools.coco")
    evaluation = pytest.importorskip("pycocotools.cocoeval")
    seen = 0
    for split in SPLITS:
        for end in ("", "_polygons"):
            coco = coco_module.COCO(str(everything / "coco" / "annotations" / f"{split}{end}.json"))
            for one in coco.loadAnns(coco.getAnnIds(catIds=coco.getCatIds(catNms=["tango@low"]))):
                frame = frames[one["image_id"]]
                apart = np.count_nonzero(coco.annToMask(one) != (frame.mask > 0))
                # outlines fill holes; run lengths are the mask itself
                assert apart <= (0.04 * np.count_nonzero(frame.mask) if end else 0)
                seen += 1
        # its own evaluation gives full marks to the truth: boxes, masks, keypoints
        parts = coco_module.COCO(str(everything / "coco" / "annotations" / f"{split}_parts.json"))
        assert parts.getAnnIds()
    coco = coco_module.COCO(str(everything / "coco" / "annotations" / "train.json"))
    answers = [
        {k: a[k] for k in ("image_id", "category_id", "bbox", "segmentation", "keypoints")} | {"score": 1.0}
        for a in coco.dataset["annotations"]
    ]
    for answer in answers:
        size = answer["segmentation"]["size"]
        rle = pytest.importorskip("pycocotools.mask").frPyObjects(answer["segmentation"], *size)
        answer["segmentation"] = rle | {"counts": rle["counts"].decode()}
    for kind in ("bbox", "segm", "keypoints"):
        copies = [dict(answer) for answer in answers]
        if kind != "segm":
            copies = [{k: v for k, v in c.items() if k != "segmentation"} for c in copies]
        marks = evaluation.COCOeval(coco, coco.loadRes(copies), kind)
        if kind == "keypoints":
            marks.params.kpt_oks_sigmas = np.full(len(coco.loadCats(1)[0]["keypoints"]), 0.05)
        marks.evaluate()
        marks.accumulate()
        marks.summarize()
        assert marks.stats[0] == pytest.approx(1.0)
    assert seen == 2 * len(frames)


@pytest.mark.filterwarnings("ignore::ResourceWarning")  # the library leaves its files to Python
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_webdataset_by_webdataset(everything, frames):
    webdataset = pytest.importorskip("webdataset")
    for split in SPLITS:
        url = str(everything / "webdataset" / f"{split}-000000.tar")
        samples = list(webdataset.WebDataset(url, shardshuffle=False))
        assert [int(s["__key__"]) for s in samples] == [k for k, f in frames.items() if f.split == split]
        for sample in samples:
            frame = frames[int(sample["__key__"])]
            assert json.loads(sample["json"])["box_px"] == list(frame.truth.box_px)
            assert sample["mask.png"] == frame.read("mask.png")
            assert sample["depth.exr"] == frame.layer_bytes("depth")
        decoded = next(iter(webdataset.WebDataset(url, shardshuffle=False).decode("l8")))
        assert (decoded["png"] == frames[int(decoded["__key__"])].image).all()


def test_parquet_by_datasets(everything, frames, tmp_path, monkeypatch):
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setenv("HF_HOME", str(tmp_path / "hub"))
    datasets = pytest.importorskip("datasets")
    found = datasets.load_dataset(str(everything / "parquet"), cache_dir=str(tmp_path / "cache"))
    assert set(found) == set(SPLITS)  # by the README's own configuration
    for split in SPLITS:
        assert found[split].features["image"] == datasets.Image()
        for row in found[split]:
            frame = frames[row["number"]]
            assert frame.split == split
            assert (np.asarray(row["image"]) == frame.image).all()
            assert (np.asarray(row["mask"]) == frame.mask).all()
            assert tuple(row["q_camera_from_target_wxyz"]) == frame.truth.q_camera_from_target_wxyz
            assert row["keypoints_state"] == [k.state for k in frame.truth.keypoints]
            assert json.loads(row["truth_json"])["seed"] == frame.truth.seed
            assert row["depth_file"] == frame.layer_bytes("depth")
    card = pytest.importorskip("huggingface_hub").DatasetCard.load(everything / "parquet" / "README.md")
    assert card.data.license == "other"
    assert [c["split"] for c in card.data.configs[0]["data_files"]] == ["train", "validation", "test"]


def test_parquet_by_pyarrow_alone(everything, frames):
    parquet = pytest.importorskip("pyarrow.parquet")
    rows = parquet.read_table(everything / "parquet" / "data" / "train-00000.parquet").to_pylist()
    assert [row["number"] for row in rows] == [k for k, f in frames.items() if f.split == "train"]
    from PIL import Image

    image = np.asarray(Image.open(io.BytesIO(rows[0]["image"]["bytes"])))
    assert (image == frames[rows[0]["number"]].image).all()


def test_frames_by_torch(everything, frames):
    torch = pytest.importorskip("torch")
    loader = torch.utils.data.DataLoader(fa.open_dataset(everything, "train").torch(), batch_size=2)
    batch = next(iter(loader))
    first = frames[int(batch["number"][0])]
    assert batch["image"].shape == (2, 1, *first.image.shape)
    np.testing.assert_allclose(batch["image"][0, 0].numpy() * 255, first.image, atol=1e-4)
    assert (batch["mask"][0].numpy() == (first.mask > 0)).all()
    assert batch["t_camera_from_target_m"][0].tolist() == pytest.approx(first.truth.t_camera_from_target_m)
