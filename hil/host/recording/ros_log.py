"""Recorder of a run as ROS 2 messages: to an MCAP file, and live to Foxglove or Lichtblick over a WebSocket.

Needs the optional dependencies ``flyaround[logs]`` (foxglove-sdk, rosbags).
"""

from __future__ import annotations

import contextlib
import logging
import math
import os
from typing import TYPE_CHECKING, Any

from flyaround.hil.host.frame_record import DURATIONS
from flyaround.hil.host.recording.cut_mcap import repair_mcap
from flyaround.simulator.dataset.formats.ros_messages import (
    DEFINITIONS,
    TARGET_FRAME,
    camera_info,
    header,
    image,
    pose_stamped,
    ros_definition,
    transform,
)
from flyaround.simulator.errors import UserError, missing_extra
from flyaround.simulator.world.time.instant import nanoseconds_utc

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.simulator.frame import Frame


ESTIMATE_FRAME, FRAME_TIMING = "target_estimate", "flyaround_msgs/msg/FrameTiming"

FRAME_TIMING_DEFINITION = ros_definition(
    "std_msgs/Header header\nuint32 frame_id\nstring outcome\nstring reason\nfloat64 confidence\n"
    + "".join(f"float64 {name}\n" for name in DURATIONS)
    + "string[] stage_names\nfloat64[] stage_ms\nfloat64 position_error_m\nfloat64 attitude_error_deg\n"
)
"""ROS 2 definition of the message ``flyaround_msgs/FrameTiming``."""


def frame_timing(row: FrameRecord) -> dict[str, Any]:
    """Convert a row of the ledger to a ``flyaround_msgs/FrameTiming`` message; unknown values become NaN."""
    durations = {name: getattr(row, name) for name in DURATIONS}
    return {
        "header": header(row.epoch_utc),
        "frame_id": row.frame_id,
        "outcome": row.outcome,
        "reason": row.reason,
        "confidence": _nan_if_none(row.confidence),
        **{name: _nan_if_none(value) for name, value in durations.items()},
        "stage_names": list(row.stages_ms),
        "stage_ms": [float(ms) for ms in row.stages_ms.values()],
        "position_error_m": _nan_if_none(row.E_T_m),
        "attitude_error_deg": _nan_if_none(row.E_R_deg),
    }


def _nan_if_none(value: float | None) -> float:
    return math.nan if value is None else float(value)


logger = logging.getLogger(__name__)

TOPICS = {
    "/camera/image_raw": "sensor_msgs/msg/Image",
    "/camera/camera_info": "sensor_msgs/msg/CameraInfo",
    "/truth/pose": "geometry_msgs/msg/PoseStamped",
    "/estimate/pose": "geometry_msgs/msg/PoseStamped",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/timing": FRAME_TIMING,
}
"""Topics with their message types."""


class _TolerantFile:
    """New file that never raises while it is written: it keeps the first error and discards all later data.

    The MCAP writer of foxglove-sdk cannot handle a full disk, and needs consistent positions from ``seek``.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("xb")
        self._end = 0  # position that the writer assumes after an error
        self.error: OSError | None = None

    def write(self, data: bytes) -> int:
        """Write the data, or discard it after an error; return its length in both cases."""
        if self.error is None:
            try:
                return self._file.write(data)
            except OSError as error:
                self._fail(error)
        self._end += len(data)
        return len(data)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Seek like a file."""
        if self.error is None:
            try:
                return self._file.seek(offset, whence)
            except OSError as error:
                self._fail(error)
        if whence == os.SEEK_SET:
            self._end = offset
        return self._end

    def flush(self) -> None:
        """Flush like a file."""
        if self.error is None:
            try:
                self._file.flush()
            except OSError as error:
                self._fail(error)

    def close(self) -> None:
        """Close like a file."""
        self.flush()
        with contextlib.suppress(OSError):  # raised for data still to be written
            self._file.close()

    def _fail(self, error: OSError) -> None:
        self.error = error
        with contextlib.suppress(OSError):
            self._end = os.fstat(self._file.fileno()).st_size


class RosLog:
    """Recorder of images, true poses, estimates and timing, stamped with the scenario's time (UTC).

    Parameters
    ----------
    path : Path or None
        MCAP file to write, or None.
    live : tuple of str and int, optional
        Host and port of a WebSocket to serve, or None.

    Raises
    ------
    UserError
        If the extra is not installed, the file exists already, or the port is in use.
    """

    def __init__(self, path: Path | None, live: tuple[str, int] | None = None) -> None:
        try:
            import foxglove  # noqa: PLC0415 - optional dependency

            from flyaround.hil.host.recording.cdr import CdrEncoder  # noqa: PLC0415 - optional dependency
        except ImportError as error:
            raise missing_extra("--mcap or --live", "logs", error) from error
        # channels hold only a weak reference to their context, so keep it alive
        self._context = context = foxglove.Context()
        definitions = DEFINITIONS | {FRAME_TIMING: FRAME_TIMING_DEFINITION}
        self._encoder = CdrEncoder({kind: definitions[kind] for kind in TOPICS.values()})
        self._channels: dict[str, Any] = {}
        for topic, kind in TOPICS.items():
            schema = foxglove.Schema(name=kind, encoding="ros2msg", data=definitions[kind].encode())
            self._channels[topic] = foxglove.Channel(
                topic, schema=schema, message_encoding="cdr", context=context
            )
        self._path, self._file, self._server = path, None, None
        self._data: _TolerantFile | None = None
        self._failure = ""
        try:
            if path is not None:
                path.parent.mkdir(parents=True, exist_ok=True)
                options = foxglove.mcap.MCAPWriteOptions(profile="ros2")
                self._data = _TolerantFile(path)
                self._file = foxglove.open_mcap(self._data, context=context, writer_options=options)
            if live is not None:
                host, port = live
                self._server = foxglove.start_server(name="flyaround", host=host, port=port, context=context)
        except (FileExistsError, OSError, RuntimeError) as error:
            at_file = path is not None and self._file is None
            where = path if at_file or live is None else f"ws://{live[0]}:{live[1]}"
            with contextlib.suppress(OSError):
                self.close()
            raise UserError(f"{where} cannot be opened ({error}): name another") from error

    @property
    def port(self) -> int | None:
        """Port of the live view."""
        return None if self._server is None else int(self._server.port)

    def frame(self, frame: Frame) -> None:
        """Write the image, its camera and the true pose."""
        epoch = frame.scene.epoch_utc
        self._log("/camera/image_raw", image(frame.image, epoch), epoch)
        self._log("/camera/camera_info", camera_info(frame.scene.camera, epoch), epoch)
        if frame.truth is not None:
            q, t = frame.truth.q_camera_from_target_wxyz, frame.truth.t_camera_from_target_m
            self._log("/truth/pose", pose_stamped(q, t, epoch), epoch)
            self._log("/tf", transform(q, t, epoch, TARGET_FRAME), epoch)

    def row(self, frame: Frame, row: FrameRecord) -> None:
        """Write the estimated pose, if accepted, and the timing of the frame."""
        epoch = frame.scene.epoch_utc
        if row.outcome == "accepted" and row.q_wxyz is not None and row.t_m is not None:
            self._log("/estimate/pose", pose_stamped(row.q_wxyz, row.t_m, epoch), epoch)
            self._log("/tf", transform(row.q_wxyz, row.t_m, epoch, ESTIMATE_FRAME), epoch)
        self._log("/timing", frame_timing(row), epoch)

    def _log(self, topic: str, value: dict[str, Any], epoch_utc: str) -> None:
        self._channels[topic].log(
            self._encoder.encode(TOPICS[topic], value), log_time=nanoseconds_utc(epoch_utc)
        )
        if self._data is not None and self._data.error is not None:
            sentence = self._give_up_file()
            if self._server is None:
                raise OSError(sentence)
            logger.warning("%s; the live view continues", sentence)

    def _give_up_file(self) -> str:
        """Close a file that can no longer be written, and return the error message; empty if it is complete."""
        file, data = self._file, self._data
        self._file = self._data = None
        if file is not None:
            file.close()
        if data is None:
            return ""
        data.close()
        if data.error is None or self._path is None:
            return ""
        with contextlib.suppress(OSError):
            repair_mcap(self._path)
        self._failure = (
            f"{self._path} cannot be written ({data.error.strerror}); it ends there and is readable: free some space,"
            " or record elsewhere"
        )
        return self._failure

    def close(self) -> None:
        """Finish the file and stop the server.

        Raises
        ------
        OSError
            If an earlier write or the end of the file failed.
        """
        self._give_up_file()
        if self._server is not None:
            self._server.stop()
        self._server = None
        if self._failure:
            raise OSError(self._failure)
