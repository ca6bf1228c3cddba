"""Picture of the annotations in a COCO export, drawn from its files only: python -m tools.docs.coco_picture."""

import json
import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np

import flyaround as fa
from flyaround.simulator.dataset.formats.coco import FIRST_CLASS_ID
from flyaround.simulator.dataset.formats.native import read_png
from flyaround.simulator.reports.pictures import write_jpeg
from flyaround.simulator.runtime.arrays import ByteArray

PLACE = Path(__file__).parents[2] / "docs" / "images" / "datasets" / "coco.jpg"
SEED, MARGIN_PX, TILE = 12, 60, (800, 600)
OUTLINE, BOX = (0, 200, 120), (230, 160, 30)
V_COLOURS = {1: (90, 150, 255), 2: (255, 80, 60)}
CLASS_COLOURS = (
    (86, 180, 233),
    (230, 159, 0),
    (213, 94, 0),
    (204, 121, 167),
    (240, 228, 66),
    (0, 158, 115),
    (150, 150, 150),
)
SHIFT = 4  # OpenCV draws to 1/16 px


def annotations(folder: Path, name: str) -> dict[str, Any]:
    """Return a list of the annotation file."""
    return dict(json.loads((folder / "annotations" / f"{name}.json").read_text()))


def fixed(points: Any) -> Any:  # noqa: ANN401 - a list of numbers of a file
    """Return points in pixels as fixed-point integers, shifted from pixel corners to OpenCV's pixel centres."""
    return np.rint((np.reshape(points, (-1, 1, 2)) - 0.5) * 2**SHIFT).astype(np.int32)


def decoded(runs: dict[str, Any]) -> ByteArray:
    """Return the mask of a run-length encoding."""
    values = np.arange(len(runs["counts"])) % 2
    flat = np.repeat(values, runs["counts"]).astype(np.uint8)
    return flat.reshape(runs["size"][::-1]).T


def main() -> None:
    """Draw two tiles: outline, bounding box and keypoints by visibility ``v``; parts by class."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "set"
        plan = fa.plan_recipe("inspection", 1, seed=SEED, target="soyuz-ms", bands="rgb")
        fa.capture(plan, folder, formats=("coco",), labels=("parts",))
        coco = folder / "coco"
        image = np.asarray(read_png(coco / "images" / "train" / "000000.png"), np.uint8)
        left, right = image.copy(), image.copy()
        one = annotations(coco, "train_polygons")["annotations"][0]
        cv2.polylines(left, [fixed(p) for p in one["segmentation"]], True, OUTLINE, 2, cv2.LINE_AA, SHIFT)
        x, y, w, h = one["bbox"]
        corners = fixed([(x, y), (x + w, y), (x + w, y + h), (x, y + h)])
        cv2.polylines(left, [corners], True, BOX, 2, cv2.LINE_AA, SHIFT)
        triples = np.reshape(one["keypoints"], (-1, 3))
        for centre, v in zip(fixed(triples[:, :2])[:, 0].tolist(), triples[:, 2].astype(int), strict=True):
            if v:
                cv2.circle(left, centre, 9 << SHIFT, (255, 255, 255), -1, cv2.LINE_AA, SHIFT)
                cv2.circle(left, centre, 7 << SHIFT, V_COLOURS[int(v)], -1, cv2.LINE_AA, SHIFT)
        for part in annotations(coco, "train_parts")["annotations"]:
            on = decoded(part["segmentation"]) > 0
            colour = CLASS_COLOURS[part["category_id"] - FIRST_CLASS_ID]
            right[on] = (0.45 * right[on] + 0.55 * np.array(colour)).astype(np.uint8)
        tiles = [cv2.resize(tile, TILE, interpolation=cv2.INTER_AREA) for tile in cropped(left, right, one)]
    write_jpeg(PLACE, np.hstack(tiles), quality=85)


def cropped(left: ByteArray, right: ByteArray, one: dict[str, Any]) -> list[ByteArray]:
    """Return both images cropped around the craft, in the shape of a tile."""
    x, y, w, h = one["bbox"]
    height, width = left.shape[:2]
    tall = min(max(h + 2 * MARGIN_PX, (w + 2 * MARGIN_PX) * TILE[1] / TILE[0]), height)
    wide = min(tall * TILE[0] / TILE[1], width)
    x0 = int(np.clip(x + w / 2 - wide / 2, 0, width - wide))
    y0 = int(np.clip(y + h / 2 - tall / 2, 0, height - tall))
    return [picture[y0 : y0 + int(tall), x0 : x0 + int(wide)] for picture in (left, right)]


if __name__ == "__main__":
    main()
