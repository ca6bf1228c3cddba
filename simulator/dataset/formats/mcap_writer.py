"""MCAP with ROS 2 messages: ``SPLIT-NNNNN.mcap`` of images, cameras, true poses, masks and whole records.

Times are the frames' own, in UTC; imported images count from the first one.
"""

from __future__ import annotations

import io
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

from flyaround.simulator.dataset.formats.base import DatasetFormat, FormatOutput, FormatWriter, import_needed
from flyaround.simulator.dataset.formats.ros_messages import (
    DEFINITIONS,
    TARGET_FRAME,
    camera_info,
    header,
    pose_stamped,
    transform,
)
from flyaround.simulator.dataset.formats.shards import Shards
from flyaround.simulator.world.time.instant import nanoseconds_utc

if TYPE_CHECKING:
    from collections.abc import Iterable

    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame

TOPICS = {
    "/camera/image_raw/compressed": "sensor_msgs/msg/CompressedImage",
    "/camera/camera_info": "sensor_msgs/msg/CameraInfo",
    "/truth/pose": "geometry_msgs/msg/PoseStamped",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/truth/mask/compressed": "sensor_msgs/msg/CompressedImage",
    "/truth/record": "std_msgs/msg/String",
}
"""Message types by topic."""

# Epoch of frames that have none.
_NO_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


class McapWriter:
    """Writer of data sets in the MCAP format."""

    def __init__(self, output: FormatOutput, _card: DatasetCard) -> None:
        self._output = output
        self._ros = import_needed("mcap_ros2.writer", "logs", "mcap")
        self._shards: Shards[tuple[int, int, dict[str, Any]]] = Shards(self._shard)

    def write(self, frame: LabelledFrame) -> None:
        """Write the frame's messages into a shard of its split."""
        messages, time_ns = messages_of(frame)
        size = sum(len(message["data"]) for message in messages.values() if "data" in message)
        self._shards.add(frame.split or "train", (frame.number, time_ns, messages), size)

    def _shard(self, split: str, number: int, items: list[tuple[int, int, dict[str, Any]]]) -> None:
        buffer = io.BytesIO()
        writer = self._ros.Writer(buffer)
        schemas = {kind: writer.register_msgdef(kind, DEFINITIONS[kind]) for kind in _unique(TOPICS.values())}
        for frame, time_ns, messages in items:
            for topic, message in messages.items():
                writer.write_message(topic, schemas[TOPICS[topic]], message, time_ns, time_ns, frame)
        writer.finish()
        self._output.write(f"{split}-{number:05d}.mcap", buffer.getvalue())

    def finish(self) -> None:
        """Write the last shards."""
        self._shards.finish()


def _unique(names: Iterable[str]) -> list[str]:
    """Return the names without duplicates, in order."""
    return list(dict.fromkeys(names))


def messages_of(frame: LabelledFrame) -> tuple[dict[str, dict[str, Any]], int]:
    """Return the messages of a frame by topic, and their time [ns]."""
    truth = frame.truth
    stamp = getattr(truth, "epoch_utc", "") or (_NO_EPOCH + timedelta(seconds=truth.t_s)).isoformat()
    q, t = truth.q_camera_from_target_wxyz, truth.t_camera_from_target_m

    def png(ending: str) -> dict[str, Any]:
        return {"header": header(stamp), "format": "png", "data": frame.read(ending)}

    messages = {
        "/camera/image_raw/compressed": png("png"),
        "/camera/camera_info": camera_info(frame.camera, stamp),
        "/truth/pose": pose_stamped(q, t, stamp),
        "/tf": transform(q, t, stamp, TARGET_FRAME),
        "/truth/mask/compressed": png("mask.png"),
        "/truth/record": {"data": frame.read("json").decode()},
    }
    return messages, nanoseconds_utc(stamp)


def _mcap(output: FormatOutput, card: DatasetCard) -> FormatWriter:
    return McapWriter(output, card)


MCAP = DatasetFormat(
    name="mcap",
    title="MCAP with ROS 2 messages",
    carries="image and mask (PNG), camera, pose, and the whole record",
    lacks="depth and other layers",
    writer=_mcap,
    needs=("mcap_ros2.writer", "logs"),
)
