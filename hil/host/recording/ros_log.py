"""A run as ROS 2 messages: in an MCAP file, and live to Foxglove or Lichtblick over a WebSocket.

Optional parts: the extra ``logs`` (foxglove-sdk, mcap-ros2-support).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hil.host.recording.ros_messages import (
    DEFINITIONS,
    ESTIMATE_FRAME,
    TARGET_FRAME,
    camera_info,
    frame_timing,
    image,
    pose_stamped,
    transform,
)
from simulator.errors import UserError
from simulator.world.time.instant import nanoseconds_utc

if TYPE_CHECKING:
    from pathlib import Path

    from hil.host.ledger.frames_csv import LedgerRow
    from simulator.frame import Frame

TOPICS = {
    "/camera/image_raw": "sensor_msgs/msg/Image",
    "/camera/camera_info": "sensor_msgs/msg/CameraInfo",
    "/truth/pose": "geometry_msgs/msg/PoseStamped",
    "/estimate/pose": "geometry_msgs/msg/PoseStamped",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/timing": "flyaround_msgs/msg/FrameTiming",
}
"""What is written, and as what."""


class RosLog:
    """Writes frames, truth, answers and timing; times are those of the scenario, in UTC.

    Parameters
    ----------
    path : MCAP file to write, or None. live : host and port of a WebSocket to serve, or None.

    Raises
    ------
    UserError
        If the extra is not installed, the file is there already, or the port is taken.
    """

    def __init__(self, path: Path | None, live: tuple[str, int] | None = None) -> None:
        try:
            import foxglove  # noqa: PLC0415 - an optional part
            from mcap_ros2._dynamic import serialize_dynamic  # noqa: PLC0415
        except ImportError as error:
            raise UserError(
                f"MCAP files and the live view need {error.name}, which is not installed; "
                "run: pip install 'flyaround[logs]'"
            ) from error
        # channels know their context weakly: it lives as long as the log
        self._context = context = foxglove.Context()
        self._encoders: dict[str, Any] = {}
        self._channels: dict[str, Any] = {}
        for topic, kind in TOPICS.items():
            self._encoders[topic] = serialize_dynamic(kind, DEFINITIONS[kind])[kind]
            schema = foxglove.Schema(name=kind, encoding="ros2msg", data=DEFINITIONS[kind].encode())
            self._channels[topic] = foxglove.Channel(
                topic, schema=schema, message_encoding="cdr", context=context
            )
        self._file = self._server = None
        try:
            if path is not None:
                path.parent.mkdir(parents=True, exist_ok=True)
                options = foxglove.mcap.MCAPWriteOptions(profile="ros2")
                self._file = foxglove.open_mcap(str(path), context=context, writer_options=options)
            if live is not None:
                host, port = live
                self._server = foxglove.start_server(name="flyaround", host=host, port=port, context=context)
        except (FileExistsError, OSError, RuntimeError) as error:
            self.close()
            where = (
                path
                if path is not None and self._file is None
                else f"ws://{live[0]}:{live[1]}"
                if live
                else ""
            )
            raise UserError(f"{where} cannot be opened ({error}): name another") from error

    @property
    def port(self) -> int | None:
        """Port of the live view."""
        return None if self._server is None else int(self._server.port)

    def frame(self, frame: Frame) -> None:
        """The picture, its camera and the true pose."""
        epoch = frame.scene.epoch_utc
        self._log("/camera/image_raw", image(frame), epoch)
        self._log("/camera/camera_info", camera_info(frame.scene.camera, epoch), epoch)
        if frame.truth is not None:
            q, t = frame.truth.q_camera_from_target_wxyz, frame.truth.t_camera_from_target_m
            self._log("/truth/pose", pose_stamped(q, t, epoch), epoch)
            self._log("/tf", transform(q, t, epoch, TARGET_FRAME), epoch)

    def row(self, frame: Frame, row: LedgerRow) -> None:
        """The answer and its times; poses that were accepted alone."""
        epoch = frame.scene.epoch_utc
        if row.outcome == "accepted" and row.q_wxyz is not None and row.t_m is not None:
            self._log("/estimate/pose", pose_stamped(row.q_wxyz, row.t_m, epoch), epoch)
            self._log("/tf", transform(row.q_wxyz, row.t_m, epoch, ESTIMATE_FRAME), epoch)
        self._log("/timing", frame_timing(row), epoch)

    def _log(self, topic: str, value: dict[str, Any], epoch_utc: str) -> None:
        self._channels[topic].log(self._encoders[topic](value), log_time=nanoseconds_utc(epoch_utc))

    def close(self) -> None:
        """Finish the file and stop the server."""
        if self._file is not None:
            self._file.close()
        if self._server is not None:
            self._server.stop()
        self._file = self._server = None
