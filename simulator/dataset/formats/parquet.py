"""Parquet for the Hugging Face library `datasets`: ``data/SPLIT-NNNNN.parquet`` and the card ``README.md``.

Images are PNG bytes that the library decodes; ``truth_json`` is the label record, layers are the native files' bytes.

References
----------
https://huggingface.co/docs/hub/datasets-cards, https://huggingface.co/docs/datasets/image_dataset
"""

from __future__ import annotations

import io
import json
from typing import TYPE_CHECKING, Any

from flyaround.simulator.dataset.formats.base import DatasetFormat, FormatOutput, FormatWriter, import_needed
from flyaround.simulator.dataset.formats.eight_bits import scale_sentence
from flyaround.simulator.dataset.formats.shards import Shards

if TYPE_CHECKING:
    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame

Row = dict[str, Any]


class ParquetWriter:
    """Writer of data sets in the Parquet format."""

    def __init__(self, output: FormatOutput, card: DatasetCard) -> None:
        self._output, self._card = output, card
        self._arrow = import_needed("pyarrow", "formats", "parquet")
        self._parquet = import_needed("pyarrow.parquet", "formats", "parquet")
        self._layers = tuple(name for name in card.labels if name != "wireframe")
        self._shards: Shards[Row] = Shards(self._shard)

    def write(self, frame: LabelledFrame) -> None:
        """Write the frame's row into a shard of its split."""
        row = row_of(frame, self._layers)
        size = sum(len(v) for v in row.values() if isinstance(v, bytes))
        size += len(row["image"]["bytes"]) + len(row["mask"]["bytes"]) + len(row["truth_json"])
        self._shards.add(frame.split or "train", row, size)

    def _shard(self, split: str, number: int, rows: list[Row]) -> None:
        table = self._arrow.Table.from_pylist(rows, schema=self._schema())
        buffer = io.BytesIO()
        # images are compressed already
        self._parquet.write_table(table, buffer, compression="zstd", row_group_size=100)
        self._output.write(f"data/{split}-{number:05d}.parquet", buffer.getvalue())

    def _schema(self) -> Any:  # noqa: ANN401 - the library has no types
        a = self._arrow
        numbers = a.list_(a.float64())
        picture = a.struct([("bytes", a.binary()), ("path", a.string())])
        types = {
            "Image": picture,
            "int64": a.int64(),
            "bool": a.bool_(),
            "float64": a.float64(),
            "string": a.string(),
            "binary": a.binary(),
            "numbers": numbers,
            "strings": a.list_(a.string()),
            "points": a.list_(numbers),
        }
        fields = columns(self._layers)
        features = json.dumps({"info": {"features": {name: _feature(kind) for name, kind in fields.items()}}})
        return a.schema([(n, types[k]) for n, k in fields.items()], metadata={"huggingface": features})

    def finish(self) -> None:
        """Write the last shards, and the card."""
        self._shards.finish()
        text = readme(self._card, self._shards.counts, columns(self._layers))
        self._output.write("README.md", text.encode())


def columns(layers: tuple[str, ...]) -> dict[str, str]:
    """Return the names and kinds of the columns."""
    return {
        "number": "int64",
        "image": "Image",
        "mask": "Image",
        "q_camera_from_target_wxyz": "numbers",
        "t_camera_from_target_m": "numbers",
        "camera_matrix": "numbers",
        "distortion": "numbers",
        "box_px": "numbers",
        "keypoints_name": "strings",
        "keypoints_pixel_px": "points",
        "keypoints_state": "strings",
        "feasible": "bool",
        "epoch_utc": "string",
        "truth_json": "string",
        **{f"{name}_file": "binary" for name in layers},
    }


def row_of(frame: LabelledFrame, layers: tuple[str, ...]) -> Row:
    """Return one frame as a row; a keypoint behind the camera has an empty list as pixel."""
    truth, stem = frame.truth, f"{frame.number:06d}"
    return {
        "number": frame.number,
        "image": {"bytes": frame.read("png"), "path": f"{stem}.png"},
        "mask": {"bytes": frame.read("mask.png"), "path": f"{stem}.mask.png"},
        "q_camera_from_target_wxyz": list(truth.q_camera_from_target_wxyz),
        "t_camera_from_target_m": list(truth.t_camera_from_target_m),
        "camera_matrix": frame.camera.K.ravel().tolist(),
        "distortion": list(frame.camera.distortion.coefficients),
        "box_px": None if truth.box_px is None else list(truth.box_px),
        "keypoints_name": [k.name for k in truth.keypoints],
        "keypoints_pixel_px": [list(k.pixel_px or ()) for k in truth.keypoints],
        "keypoints_state": [k.state for k in truth.keypoints],
        "feasible": truth.feasible,
        "epoch_utc": getattr(truth, "epoch_utc", None),
        "truth_json": frame.read("json").decode(),
        **{f"{name}_file": frame.layer_bytes(name) if name in frame.layers else None for name in layers},
    }


def _feature(kind: str) -> dict[str, Any]:
    """Return the `datasets` feature of a column."""
    if kind == "Image":
        return {"_type": "Image"}
    if kind in ("numbers", "strings"):
        return {"feature": _feature("float64" if kind == "numbers" else "string"), "_type": "Sequence"}
    if kind == "points":
        return {"feature": _feature("numbers"), "_type": "Sequence"}
    return {"dtype": kind, "_type": "Value"}


def readme(card: DatasetCard, counts: dict[str, int], fields: dict[str, str]) -> str:
    """Return the hub's dataset card: YAML metadata, then text."""
    title = f"{card.scenario_name}: {card.target.name}"
    lines = [
        "---",
        f"pretty_name: {json.dumps(title)}",
        "license: other",
        "task_categories:",
        "- object-detection",
        "- image-segmentation",
        "- keypoint-detection",
        "tags:",
        "- spacecraft",
        "- pose-estimation",
        "- synthetic",
        "configs:",
        "- config_name: default",
        "  data_files:",
    ]
    for split in counts:
        lines += [f"  - split: {split}", f"    path: data/{split}-*.parquet"]
    bits = card.image_bits or 8
    scale = ["", f"The {scale_sentence(bits)}."] if bits > 8 else []
    size = f"{card.camera.width_px} x {card.camera.height_px} pixels"
    sizes = ", ".join(f"{n} {name}" for name, n in counts.items())
    summary = f"{sum(counts.values())} images ({sizes}), {size}, seed {card.seed}, flyaround {card.machine.flyaround}."
    lines += [
        "---",
        "",
        f"# {title}",
        "",
        summary,
        *scale,
        "",
        "| column | kind |",
        "|---|---|",
        *(f"| `{name}` | {kind} |" for name, kind in fields.items()),
        "",
        "## Conventions",
        "",
        *(f"- **{name}**: {text}" for name, text in card.conventions.items()),
        "",
        f"Keypoints [m, model axes]: `{json.dumps(card.target.keypoints)}`",
        "",
        "## Licence",
        "",
        card.licence + ".",
        "",
    ]
    return "\n".join(lines)


def _parquet(output: FormatOutput, card: DatasetCard) -> FormatWriter:
    return ParquetWriter(output, card)


PARQUET = DatasetFormat(
    name="parquet",
    title="Parquet (Hugging Face datasets)",
    carries="image, mask, pose, camera, box, keypoints with their states, the whole record and the layers' files",
    writer=_parquet,
    needs=("pyarrow", "formats"),
)
