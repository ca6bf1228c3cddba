"""Board on a GigE Vision camera: newest image, pose estimate, row in a file and answer to a host."""

from __future__ import annotations

import json
import logging
import math
from dataclasses import dataclass, field
from typing import Any, Callable, Dict, Optional, Tuple

from flyaround.hil.board.answering import BoardEstimator, FrameContext, estimated_pose
from flyaround.hil.board.files import read_bounded
from flyaround.hil.board.frame_server import BoardSummary
from flyaround.hil.board.gige.answer_line import AnswerLine
from flyaround.hil.board.gige.camera import SCHEME, CameraFrame, CameraSettings, GigeCamera
from flyaround.hil.board.gige.pose_file import PoseFile
from flyaround.hil.board.json_values import BAD_VALUE
from flyaround.hil.link.clock import now_ns
from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.packets.messages import Hello

logger = logging.getLogger(__name__)

# Largest camera file [bytes], thousands of times the usual size.
MAX_CAMERA_BYTES = 10_000_000
_CAMERA_KEYS = {
    *("width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px", "distortion", "encoding"),
    *("pixel_pitch_um", "name", "notes"),
}
# Interval of the checks of the answer line while no image arrives [s].
CHECK_INTERVAL_S = 0.5
# Number of restarts of a silent stream before the camera counts as lost.
MAX_RESTARTS = 3


@dataclass(frozen=True)
class CameraBoardOptions:
    """Options of a board that reads a camera.

    Parameters
    ----------
    settings : CameraSettings, optional
        Region, pixel format and trigger of the camera.
    camera_file : str, optional
        File with the intrinsics of the whole detector; by default, the host at ``answer_url`` sends them.
    poses_file : str, optional
        Output file, .csv or JSON lines. By default, standard output if there is no ``answer_url``.
    answer_url : str, optional
        URL of a host that accepts poses.
    key : bytes, optional
        Key shared with that host.
    timeout_s : float, optional
        Time-out of the connection to that host.
    most_frames : int, optional
        Number of frames after which the run ends; unlimited by default.
    silence_s : float, optional
        Time without messages after which the host is considered lost.
    dark_s : float, optional
        Time without a complete image after which the stream is restarted.
    """

    settings: CameraSettings = field(default_factory=CameraSettings)
    camera_file: Optional[str] = None
    poses_file: Optional[str] = None
    answer_url: Optional[str] = None
    key: Optional[bytes] = None
    timeout_s: float = 60.0
    most_frames: Optional[int] = None
    silence_s: float = 10.0
    dark_s: float = 10.0


def run_camera_board(
    url: str,
    options: CameraBoardOptions,
    make_estimator: Callable[[Dict[str, Any]], BoardEstimator],
    hello: Hello,
) -> BoardSummary:
    """Estimate and record poses from a camera until the frame limit, an interrupt, or loss of the camera.

    Parameters
    ----------
    url : str
        Address of the camera, ``gige://ADDRESS``.
    options : CameraBoardOptions
        Options of the camera board.
    make_estimator : callable
        Makes an estimator from a camera JSON object.
    hello : Hello
        HELLO message of this board for the host.

    Returns
    -------
    BoardSummary
        Counts of the pictures, and how it ended.

    Raises
    ------
    LinkError
        If Aravis is not installed, or the camera, a file or the host cannot be used.
    """
    address = url[len(SCHEME) :].rstrip("/")
    if not address:
        raise LinkError(f"{url} names no camera: write {SCHEME}192.168.10.2")
    if options.camera_file is None and options.answer_url is None:
        raise LinkError("a GigE camera does not report its intrinsics: name a file with --camera FILE")
    camera = None if options.camera_file is None else read_camera(options.camera_file)
    device = GigeCamera(address, options.settings)
    line: Optional[AnswerLine] = None
    poses: Optional[PoseFile] = None
    try:
        if options.answer_url is not None:
            line = AnswerLine(options.answer_url, hello, options.key, options.timeout_s, options.silence_s)
            camera = camera or line.camera
        assert camera is not None  # noqa: S101 - check_options requires one of the two
        check_size(camera, device.sensor_px, address)
        if options.poses_file is not None or line is None:
            poses = PoseFile(options.poses_file)
        logger.info("camera %s at %s", device.name, address)
        return _Session(device, options, camera, make_estimator, line, poses).run()
    finally:
        device.close()
        if poses is not None:
            poses.close()
        if line is not None:
            line.close("the board's agent ends")


class _Session:
    """One stream of one camera."""

    def __init__(
        self,
        device: GigeCamera,
        options: CameraBoardOptions,
        camera: Dict[str, Any],
        make_estimator: Callable[[Dict[str, Any]], BoardEstimator],
        line: Optional[AnswerLine],
        poses: Optional[PoseFile],
    ) -> None:
        self._device, self._options, self._camera = device, options, camera
        self._make, self._line, self._poses = make_estimator, line, poses
        self._estimator: Optional[BoardEstimator] = None
        self._roi_px: Tuple[int, int, int, int] = (0, 0, 0, 0)
        self._first_ns: Optional[int] = None
        self._frames = self._accepted = 0

    def run(self) -> BoardSummary:
        # before the stream starts, because preparing an estimator may take seconds
        self._prepare_estimator(self._device.roi_px)
        self._device.start()
        restarts = 0
        max_frames = math.inf if self._options.most_frames is None else self._options.most_frames
        while self._frames < max_frames:
            frame = self._next_frame()
            if self._line is not None and self._line.ended:
                return self._ended(self._line.ended, orderly=self._line.goodbye)
            if frame is not None:
                restarts = 0
                self._answer(frame)
                continue
            dark = f"no complete picture arrived for {self._options.dark_s:g} s"
            if restarts >= MAX_RESTARTS:
                return self._ended(f"{dark}, {restarts} times after a restart of the stream", orderly=False)
            restarts += 1
            logger.warning("%s (%d damaged ones): restarting the stream", dark, self._device.damaged)
            try:
                self._device.start()
            except LinkError as error:
                return self._ended(str(error), orderly=False)
        return self._ended(f"all {self._frames} requested pictures were received", orderly=True)

    def _ended(self, sentence: str, *, orderly: bool) -> BoardSummary:
        return BoardSummary(self._frames, self._accepted, orderly, f"{sentence} after {self._frames} frames")

    def _next_frame(self) -> Optional[CameraFrame]:
        """Return the newest image, or a triggered one; None on a time-out or if the host ended the session."""
        device, triggered = self._device, self._options.settings.software_trigger
        damaged, until_ns = -1, now_ns() + round(1e9 * self._options.dark_s)
        while now_ns() < until_ns and not (self._line is not None and self._line.ended):
            if device.restart_if_discarding():
                logger.warning("packets of other programs disturbed the start of the stream: restarted it")
                damaged = -1
            if triggered and damaged != device.damaged:  # the image of the last trigger was damaged
                damaged = device.damaged
                device.trigger()
            frame = device.frame(CHECK_INTERVAL_S)
            if frame is not None:
                return frame
        return None

    def _answer(self, frame: CameraFrame) -> None:
        if frame.roi_px != self._roi_px or self._estimator is None:
            self._prepare_estimator(frame.roi_px)
        assert self._estimator is not None  # noqa: S101 - _use_region made it
        if self._first_ns is None:
            self._first_ns = frame.camera_time_ns
        context = FrameContext(
            frame.number,
            (frame.camera_time_ns - self._first_ns) * 1e-9,
            frame.received_ns,
            now_ns(),
            takes_fields=self._line is not None and self._line.takes_fields,
        )
        encoding = str(self._camera.get("encoding", "linear"))
        pose = estimated_pose(self._estimator, frame.image, context, encoding)
        self._frames += 1
        self._accepted += pose.accepted
        if self._line is not None:
            self._line.send(pose)
        if self._poses is not None:
            self._poses.add(frame, pose)

    def _prepare_estimator(self, roi_px: Tuple[int, int, int, int]) -> None:
        """Prepare an estimator for a region of the detector."""
        try:
            self._estimator, self._roi_px = self._make(camera_of_part(self._camera, roi_px)), roi_px
        except Exception as error:
            raise LinkError(
                f"the estimator cannot use the camera's intrinsics ({error}): check --camera"
            ) from error


def read_camera(path: str) -> Dict[str, Any]:
    """Read a camera JSON object from a file.

    Raises
    ------
    LinkError
        If the file cannot be read, or does not hold such an object.
    """
    try:
        camera = json.loads(read_bounded(path, MAX_CAMERA_BYTES).decode("utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        raise LinkError(
            f"camera {path} cannot be used ({error}): give the camera object of a truth record"
        ) from error
    if not isinstance(camera, dict):
        raise LinkError(f"camera {path} is not a JSON object: give the camera object of a truth record")
    unknown_keys = sorted(set(camera) - _CAMERA_KEYS)
    if unknown_keys:
        raise LinkError(
            f"camera {path} has the key {unknown_keys[0]!r}, which a board does not know: write a file with"
            f" flyaround cameras {path} --export CAMERA.json"
        )
    return camera


def check_size(camera: Dict[str, Any], sensor_px: Tuple[int, int], address: str) -> None:
    """Raise unless the intrinsics are those of a detector of this size.

    Raises
    ------
    LinkError
        If the sizes differ.
    """
    size = (camera.get("width_px"), camera.get("height_px"))
    if size != sensor_px:
        raise LinkError(
            f"the intrinsics are of {size[0]} x {size[1]} pixels and the camera {address} has"
            f" {sensor_px[0]} x {sensor_px[1]}: give those of the whole detector, unbinned; --roi is applied to them"
        )


def camera_of_part(camera: Dict[str, Any], roi_px: Tuple[int, int, int, int]) -> Dict[str, Any]:
    """Return the intrinsics of a region of the detector, with the principal point shifted.

    Raises
    ------
    LinkError
        If the intrinsics have no principal point.
    """
    x, y, width, height = roi_px
    try:
        return {
            **camera,
            "width_px": width,
            "height_px": height,
            "cx_px": float(camera["cx_px"]) - x,
            "cy_px": float(camera["cy_px"]) - y,
        }
    except BAD_VALUE as error:
        raise LinkError(
            f"the camera's intrinsics lack a principal point ({error!r}): check --camera"
        ) from error
