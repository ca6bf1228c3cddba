"""Board at a GigE Vision camera: newest image, estimate, row in a file and answer to a host."""

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
from flyaround.hil.link.clock import now_ns
from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.packets.messages import Hello

logger = logging.getLogger(__name__)

# largest camera file: thousands of times the usual size
MAX_CAMERA_BYTES = 10_000_000
_CAMERA_KEYS = {
    *("width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px", "distortion", "encoding"),
    *("pixel_pitch_um", "name", "notes"),
}
# interval of checks of the answer line while no image arrives [s]
LOOK_S = 0.5
# a stream that brings nothing is begun anew so often before the camera counts as gone
MAX_RESTARTS = 3


@dataclass(frozen=True)
class CameraBoardOptions:
    """Options of a board at a camera.

    Parameters
    ----------
    camera_file : str, optional
        Intrinsics of the whole detector (CAMERA.json); None takes those of the host of ``answer_url``.
    poses_file : str, optional
        .csv or JSON lines; None writes to the standard output, unless the poses go to a host.
    answer_url : str, optional
        The host that takes poses, what it asks for, how long to try to reach it.
    key : bytes, optional
        The host that takes poses, what it asks for, how long to try to reach it.
    timeout_s : float, optional
        The host that takes poses, what it asks for, how long to try to reach it.
    most_frames : int, optional
        End after this many; None goes on until stopped.
    silence_s : float, optional
        Time without messages after which the host is considered gone.
    dark_s : float, optional
        A stream without a whole image for this long is begun anew.
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
    """Read a camera, estimate and record the poses, until enough frames came, the user stops it, or the camera is gone.

    Parameters
    ----------
    url : str
        ``gige://ADDRESS``.
    make_estimator : callable
        Makes one from a camera JSON object.
    hello : Hello
        Description of this board for the host.

    Raises
    ------
    LinkError
        If Aravis is not here, the camera, a file or the host cannot be used; the message is one sentence.
    """
    address = url[len(SCHEME) :].rstrip("/")
    if not address:
        raise LinkError(f"{url} names no camera: write {SCHEME}192.168.10.2")
    if options.camera_file is None and options.answer_url is None:
        raise LinkError(
            "a camera on the network does not tell its lens: name its intrinsics with --camera FILE"
        )
    camera = None if options.camera_file is None else read_camera(options.camera_file)
    device = GigeCamera(address, options.settings)
    line: Optional[AnswerLine] = None
    poses: Optional[PoseFile] = None
    try:
        if options.answer_url is not None:
            line = AnswerLine(options.answer_url, hello, options.key, options.timeout_s, options.silence_s)
            camera = camera or line.camera
        assert camera is not None  # noqa: S101 - one of the two is there
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
        # made before the stream begins: it may take seconds
        self._look_through(self._device.roi_px)
        self._device.start()
        restarts = 0
        most = math.inf if self._options.most_frames is None else self._options.most_frames
        while self._frames < most:
            frame = self._next_frame()
            if self._line is not None and self._line.ended:
                return self._ended(self._line.ended, orderly=self._line.goodbye)
            if frame is not None:
                restarts = 0
                self._answer(frame)
                continue
            dark = f"no whole picture came for {self._options.dark_s:g} s"
            if restarts >= MAX_RESTARTS:
                return self._ended(f"{dark}, {restarts} times after the stream was begun anew", orderly=False)
            restarts += 1
            logger.warning("%s (%d damaged ones): the stream is begun anew", dark, self._device.damaged)
            try:
                self._device.start()
            except LinkError as error:
                return self._ended(str(error), orderly=False)
        return self._ended(f"all {self._frames} pictures that were asked for have come", orderly=True)

    def _ended(self, sentence: str, *, orderly: bool) -> BoardSummary:
        return BoardSummary(self._frames, self._accepted, orderly, f"{sentence} after {self._frames} frames")

    def _next_frame(self) -> Optional[CameraFrame]:
        """Return the newest image, or one triggered now; None on a timeout or if the host ended."""
        device, triggered = self._device, self._options.settings.software_trigger
        damaged, until_ns = -1, now_ns() + round(1e9 * self._options.dark_s)
        while now_ns() < until_ns and not (self._line is not None and self._line.ended):
            if device.mend():
                logger.warning("the stream began among other programs' packets: it was begun anew")
                damaged = -1
            if triggered and damaged != device.damaged:  # the picture of the last trigger came damaged
                damaged = device.damaged
                device.trigger()
            frame = device.frame(LOOK_S)
            if frame is not None:
                return frame
        return None

    def _answer(self, frame: CameraFrame) -> None:
        if frame.roi_px != self._roi_px or self._estimator is None:
            self._look_through(frame.roi_px)
        assert self._estimator is not None  # noqa: S101 - made above
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

    def _look_through(self, roi_px: Tuple[int, int, int, int]) -> None:
        """Make an estimator for a part of the detector."""
        try:
            self._estimator, self._roi_px = self._make(camera_of_part(self._camera, roi_px)), roi_px
        except Exception as error:
            raise LinkError(
                f"the estimator cannot use the camera's intrinsics ({error}): check --camera"
            ) from error


def read_camera(path: str) -> Dict[str, Any]:
    """Return the camera JSON object of a file.

    Raises
    ------
    LinkError
        If it cannot be read or is none.
    """
    try:
        camera = json.loads(read_bounded(path, MAX_CAMERA_BYTES).decode("utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        raise LinkError(
            f"camera {path} cannot be used ({error}): give the camera object of a truth record"
        ) from error
    if not isinstance(camera, dict):
        raise LinkError(f"camera {path} is no JSON object: give the camera object of a truth record")
    odd = sorted(set(camera) - _CAMERA_KEYS)
    if odd:
        raise LinkError(
            f"camera {path} has the key {odd[0]!r}, which a board does not know: flyaround cameras {path} --export"
            " CAMERA.json writes one that it does"
        )
    return camera


def check_size(camera: Dict[str, Any], sensor_px: Tuple[int, int], address: str) -> None:
    """Raise LinkError unless the intrinsics are those of a detector of this size.

    Raises
    ------
    LinkError
        If they are of another.
    """
    size = (camera.get("width_px"), camera.get("height_px"))
    if size != sensor_px:
        raise LinkError(
            f"the intrinsics are of {size[0]} x {size[1]} pixels and the camera {address} has"
            f" {sensor_px[0]} x {sensor_px[1]}: give those of its whole detector, unbinned; --roi is taken care of"
        )


def camera_of_part(camera: Dict[str, Any], roi_px: Tuple[int, int, int, int]) -> Dict[str, Any]:
    """Return the intrinsics of a part of the detector: the principal point moves, the rays stay."""
    x, y, width, height = roi_px
    try:
        return {
            **camera,
            "width_px": width,
            "height_px": height,
            "cx_px": float(camera["cx_px"]) - x,
            "cy_px": float(camera["cy_px"]) - y,
        }
    except (KeyError, TypeError, ValueError) as error:
        raise LinkError(
            f"the camera's intrinsics lack a principal point ({error!r}): check --camera"
        ) from error
