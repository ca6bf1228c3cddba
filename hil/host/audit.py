"""Audit of a run from its images alone: comparison of their time codes with the ledger."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.hil.corner_code import CodePlace, read_code
from flyaround.hil.host.picture_frames import pictures_in
from flyaround.simulator.dataset.formats.native import read_png
from flyaround.simulator.errors import UserError, missing_extra
from flyaround.simulator.runtime.mcap_messages import mcap_messages
from flyaround.simulator.world.time.instant import nanoseconds_utc

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from flyaround.hil.host.frame_record import FrameRecord

    Pictures = Iterable[tuple[str, NDArray[Any]]]

IMAGES_TOPIC = "/camera/image_raw"
# Largest number of disagreements listed per kind.
MAX_REPORTED = 20


@dataclass(kw_only=True)
class PictureAudit:
    """Comparison of images with the ledger.

    Parameters
    ----------
    pictures : int
        Number of images.
    agree : int
        Number of images whose time code matches a row of the ledger.
    unreadable : list of str
        Images without a valid time code.
    wrong : list of str
        One sentence per image whose code disagrees with the ledger.
    twice : list of str
        Images with the code of an earlier image.
    missing : list of int
        Answered frames without an image.
    """

    pictures: int = 0
    agree: int = 0
    unreadable: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    twice: list[str] = field(default_factory=list)
    missing: list[int] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """True if at least one image agrees, every answered frame has exactly one, and none disagrees."""
        return bool(self.agree) and not (self.unreadable or self.wrong or self.twice or self.missing)


def audit_pictures(
    rows: Sequence[FrameRecord], pictures: Pictures, place: CodePlace | None = None
) -> PictureAudit:
    """Read the time code of each image and compare it with the ledger.

    Parameters
    ----------
    rows : sequence of FrameRecord
        Rows of the ledger.
    pictures : Pictures
        Name and pixels of each image.
    place : CodePlace, optional
        Position of the time code in the run.

    Returns
    -------
    PictureAudit
        Agreeing, wrong, repeated and missing frames.
    """
    place = CodePlace() if place is None else place
    by_frame = {row.frame_id: row for row in rows}
    matched_frames: set[int] = set()
    audit = PictureAudit()
    for name, image in pictures:
        audit.pictures += 1
        code = read_code(image, place)
        if code is None:
            audit.unreadable.append(name)
            continue
        row = by_frame.get(code.frame_id)
        time_ns = None if row is None else _time_ns(row)
        if row is None or time_ns is None:
            audit.wrong.append(
                f"{name} has the code of frame {code.frame_id}, which has no time in the ledger"
            )
        elif time_ns != code.time_ns:
            off_ms = 1e-6 * (code.time_ns - time_ns)
            audit.wrong.append(
                f"{name} has the code of frame {code.frame_id}, {off_ms:+.3f} ms from its time in the ledger"
            )
        elif code.frame_id in matched_frames:
            audit.twice.append(name)
        else:
            audit.agree += 1
            matched_frames.add(code.frame_id)
    answered = (row.frame_id for row in rows if row.outcome in {"accepted", "declined"})
    audit.missing = [frame_id for frame_id in answered if frame_id not in matched_frames]
    return audit


def _time_ns(row: FrameRecord) -> int | None:
    """Return the time of a row, None if its text is no time."""
    try:
        return nanoseconds_utc(row.epoch_utc)
    except ValueError:
        return None


def pictures_of(source: Path) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield name and pixels of each PNG file in a folder, or of each ROS 2 image in an MCAP file.

    Raises
    ------
    UserError
        If there are no images, or they cannot be read.
    """
    if source.is_dir():
        for path in pictures_in(source):
            yield path.name, read_png(path)
        return
    try:
        import mcap  # noqa: F401, PLC0415 - optional dependency
        from mcap_ros2.decoder import DecoderFactory  # noqa: PLC0415
    except ImportError as error:
        raise missing_extra("an MCAP file", "logs", error) from error
    count = 0
    decoders = DecoderFactory()
    try:
        with source.open("rb") as file:
            for schema, channel, message in mcap_messages(file):
                if channel.topic == IMAGES_TOPIC:
                    decode = decoders.decoder_for(channel.message_encoding, schema)
                    if decode is None:
                        raise ValueError(f"topic {IMAGES_TOPIC} does not hold ROS 2 messages")
                    yield f"picture at {message.log_time} ns", _pixels(decode(message.data))
                    count += 1
    except (OSError, ValueError, struct.error, OverflowError) as error:
        raise UserError(
            f"{source} cannot be read ({str(error) or type(error).__name__}): name a folder of PNG files, or a file "
            "written with --mcap"
        ) from error
    if not count:
        raise UserError(
            f"{source} holds no images on {IMAGES_TOPIC}; name the file of a camera that sent some"
        )


def _pixels(image: Any) -> NDArray[Any]:  # noqa: ANN401 - generated at run time from the message definition
    """Return the pixels of a sensor_msgs/Image."""
    kinds = {"mono8": ("u1", 1), "mono16": ("<u2", 1), "rgb8": ("u1", 3), "rgb16": ("<u2", 3)}
    if image.encoding not in kinds or image.is_bigendian:
        raise ValueError(f"an image has encoding {image.encoding}, allowed: {', '.join(kinds)}")
    dtype, channels = kinds[image.encoding]
    shape = (image.height, image.width) if channels == 1 else (image.height, image.width, channels)
    return np.frombuffer(bytes(image.data), dtype).reshape(shape)
