"""The board's side of the loop: connect, take frames, estimate, answer; survive a bad line."""

from __future__ import annotations

import json
import logging
import math
import platform
import queue
import threading
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Callable, Dict, Iterable, List, Optional, Protocol, Tuple, Union

from hil.board.errors import KernelError
from hil.link.clock import answer_time_sync, now_ns
from hil.link.errors import LinkClosed, LinkError, PacketError, ProtocolMistake
from hil.link.packets.enums import GREY_FORMATS, format_mask
from hil.link.packets.images import FrameAssembler, check_terms, supported_encodings
from hil.link.packets.messages import (
    NO_FRAME,
    Bye,
    Credit,
    ErrorCode,
    ErrorMessage,
    FrameChunk,
    FrameHeader,
    Hello,
    HelloAck,
    Message,
    PixelFormat,
    PoseMessage,
    TimeSyncRequest,
)
from hil.link.packets.packet import PacketType
from hil.link.packets.pixels import Image
from hil.link.security import prove_to_host
from hil.link.session import Link, greet_host
from hil.link.transports.url import connect

logger = logging.getLogger(__name__)

SUFFIX = ".board.json"

# damage and mistakes of a session that are logged one by one: a line that does nothing else fills no disk
MAX_LOGGED = 100


class Estimate(Protocol):
    """What an estimator returns; ``hil.board.svd.PoseResult`` is one."""

    @property
    def accepted(self) -> bool:
        """Whether the estimator stands by the pose."""

    @property
    def reason(self) -> str:
        """Why it was accepted or declined."""

    @property
    def q_camera_from_target_wxyz(self) -> Optional[Iterable[float]]:
        """(4,) unit quaternion, or None."""

    @property
    def t_camera_from_target_m(self) -> Optional[Iterable[float]]:
        """(3,) [m], or None."""

    @property
    def confidence(self) -> float:
        """0 to 1."""

    @property
    def stages_ms(self) -> Dict[str, float]:
        """Duration of each stage, in order [ms]."""


class BoardEstimator(Protocol):
    """What the agent runs on each frame."""

    def estimate(self, image: Any) -> Estimate:  # noqa: ANN401 - (H, W) uint8; an estimator may take more
        """Pose of the target in an (H, W) image.

        One that follows the target from frame to frame has an attribute ``keeps_state`` that is true, and is given
        ``t_s``, the time of mid-exposure [s], as well.
        """


# camera JSON object to estimator: the camera is known only after the handshake
EstimatorFactory = Callable[[Dict[str, Any]], BoardEstimator]


@dataclass(frozen=True)
class BoardSummary:
    """What the board did in a session.

    Parameters
    ----------
    goodbye : whether the host ended the session in order.
    ended : one sentence saying how it ended.
    """

    frames: int
    accepted: int
    goodbye: bool
    ended: str


@dataclass(frozen=True)
class _Arrival:
    header: FrameHeader
    image: Image
    receive_ns: int


def svd_factory(model_path: Union[str, Path], method: str) -> Tuple[EstimatorFactory, str, str]:
    """The SVD estimator on a model file: factory, model name, model hash.

    Raises
    ------
    LinkError
        If the model file, the method or the kernels that are asked for cannot be used.
    """
    from hil.board.svd import (  # noqa: PLC0415 - needs OpenCV
        METHODS,
        BoardModel,
        CameraIntrinsics,
        make_estimator,
    )
    from hil.board.svd.native.backend import describe_backend  # noqa: PLC0415 - the same

    try:
        # built and loaded before a host is met
        logger.info("kernels of the estimator: %s", describe_backend())
    except KernelError as error:
        raise LinkError(str(error)) from error
    if method not in METHODS:
        raise LinkError(f"unknown method {method!r}: choose one of {', '.join(METHODS)}")

    try:
        inside = _bundled(str(model_path))
        model = (
            BoardModel.read(str(model_path)) if inside is None else BoardModel.from_dict(json.loads(inside))
        )
    except (OSError, ValueError) as error:
        raise LinkError(f"{error}: write it anew on the host and copy it to the board") from error

    def make(camera: Dict[str, Any]) -> BoardEstimator:
        return make_estimator(model, CameraIntrinsics.from_dict(camera), method)

    return make, model.name, model.sha256


def bundled_models() -> List[str]:
    """Names of the board models that came with this program: a bundle has some, a checkout none."""
    names = [item.name for item in _models().iterdir()] if _models().is_dir() else []
    return sorted(name[: -len(SUFFIX)] for name in names if name.endswith(SUFFIX))


def _bundled(name: str) -> Optional[bytes]:
    if Path(name).is_file() or name not in bundled_models():
        return None
    return (_models() / (name + SUFFIX)).read_bytes()


def _models() -> Any:  # noqa: ANN401 - a Path, or its like inside a zip
    return files("hil.board").joinpath("models")


def run_board(
    url: str,
    model_path: Union[str, Path, None] = None,
    method: str = "svd",
    *,
    make_estimator: Optional[EstimatorFactory] = None,
    model_name: str = "",
    model_sha256: str = "",
    connect_timeout_s: float = 60.0,
    window: int = 2,
    key: Optional[bytes] = None,
    takes_colour: bool = False,
) -> BoardSummary:
    """Serve one session with a host, to its end.

    Parameters
    ----------
    url : the host.
    model_path : board model file for the SVD estimator, or a bundled one's name; not needed with ``make_estimator``.
    make_estimator : any estimator, made once the camera is known.
    connect_timeout_s : how long to try to reach the host, and then to wait for its first word.
    window : frames held at once, the one in work included.
    key : shared with the host, which must prove that it has it; None where it asks for none.
    takes_colour : whether ``make_estimator``'s takes (H, W, 3) images as well.

    Raises
    ------
    LinkError
        If the host cannot be reached or refuses, or the model cannot be used: one sentence.
    """
    runs_on = ""
    if make_estimator is None:
        if model_path is None:
            raise LinkError("the board needs a model file: name one with --model")
        make_estimator, model_name, model_sha256 = svd_factory(model_path, method)
        from hil.board.svd.native.backend import describe_backend  # noqa: PLC0415 - needs OpenCV

        runs_on = f", kernels {describe_backend().split()[0]}"
    hello = Hello(
        encodings=supported_encodings(),
        window=window,
        model_name=model_name,
        model_sha256=model_sha256,
        method=method,
        board=f"{platform.node()} {platform.machine()} Python {platform.python_version()}{runs_on}",
        pixel_formats=format_mask(PixelFormat if takes_colour else GREY_FORMATS),
    )
    line = connect(url, connect_timeout_s)
    try:
        link = Link(line if key is None else prove_to_host(line, key))
    except LinkError:
        line.close()
        raise
    try:
        repeat_s = 1.0 if url.startswith("serial") else math.inf
        terms = greet_host(link, hello, connect_timeout_s, repeat_s=repeat_s)
        # what the estimator is under test for is not even decoded here
        link.accepts = link.accepts - {PacketType.TRUTH}
        estimator = _make(make_estimator, terms, hello, link)
        logger.info("session with %s: %d x %d px", url, terms.width_px, terms.height_px)
        return _Session(link, terms, estimator, hello.window).run()
    finally:
        link.close("the board's agent ends")


def _make(make_estimator: EstimatorFactory, terms: HelloAck, hello: Hello, link: Link) -> BoardEstimator:
    try:
        check_terms(terms, hello.encodings, hello.pixel_formats)
        return make_estimator(terms.camera)
    except Exception as error:
        sentence = f"the board cannot use the host's camera ({error}): check the scenario's camera"
        link.send(ErrorMessage(ErrorCode.FORMAT, sentence))
        raise LinkError(sentence) from error


class _Session:
    """Two threads: one takes packets and answers clock requests, one estimates."""

    def __init__(self, link: Link, terms: HelloAck, estimator: BoardEstimator, window: int) -> None:
        self._link, self._terms, self._estimator = link, terms, estimator
        # whole frames that wait: no more than this board said it can hold, whatever the host makes of it
        self._room = max(1, min(window, terms.window))
        self._arrivals: queue.Queue[Optional[_Arrival]] = queue.Queue()
        self._assembler = FrameAssembler(terms)
        self._logged = 0
        self._goodbye = False
        self._newest = NO_FRAME
        self._ended = "the host went away"
        self._stop = threading.Event()

    def run(self) -> BoardSummary:
        frames = accepted = 0
        receiver = threading.Thread(target=self._receive, name="link receiver", daemon=True)
        receiver.start()
        try:
            while True:
                arrival = self._arrivals.get()
                if arrival is None:
                    break
                pose = self._answer(arrival)
                frames += 1
                accepted += pose.accepted
                try:
                    self._link.send(pose)
                    self._link.send(Credit(pose.frame_id, self._terms.window))
                except LinkClosed:
                    break  # the receiver says why
        finally:
            self._stop.set()
            receiver.join(2.0)
        return BoardSummary(frames, accepted, self._goodbye, f"{self._ended} after {frames} frames")

    # --- estimating -------------------------------------------------------------------------

    def _answer(self, arrival: _Arrival) -> PoseMessage:
        frame_id, start_ns = arrival.header.frame_id, now_ns()
        try:
            result = self._look(arrival)
            end_ns = now_ns()
            pose = PoseMessage(
                frame_id,
                bool(result.accepted),
                str(result.reason),
                _numbers(result.q_camera_from_target_wxyz),
                _numbers(result.t_camera_from_target_m),
                float(result.confidence),
                tuple((name, float(ms)) for name, ms in result.stages_ms.items()),
                arrival.receive_ns,
                start_ns,
                end_ns,
            )
            pose.encode()  # an accepted pose that is missing or not finite is found here
            return pose
        except Exception as error:  # noqa: BLE001 - whatever it raises, the next frame is another chance
            logger.warning("frame %d: the estimator failed: %r", frame_id, error)
            return PoseMessage(
                frame_id,
                accepted=False,
                reason=f"the estimator failed: {type(error).__name__}: {error}",
                receive_ns=arrival.receive_ns,
                start_ns=start_ns,
                end_ns=now_ns(),
            )

    def _look(self, arrival: _Arrival) -> Estimate:
        if getattr(self._estimator, "keeps_state", False):
            estimate: Callable[..., Estimate] = self._estimator.estimate
            return estimate(arrival.image, t_s=arrival.header.t_s)
        return self._estimator.estimate(arrival.image)

    # --- receiving --------------------------------------------------------------------------

    def _receive(self) -> None:
        try:
            while not self._stop.is_set():
                try:
                    message = self._link.recv(0.5)
                    if message is not None and not self._take(message):
                        return
                except ProtocolMistake as mistake:
                    self._mistaken(mistake)
                except PacketError as error:
                    self._damaged(error)
                self._report_lost()
        except LinkClosed as error:
            self._ended = f"the host went away without a goodbye ({error})"
        finally:
            self._arrivals.put(None)

    def _take(self, message: Message) -> bool:
        """Handle one message; False ends the session. Truth, where it is sent along, is not looked at."""
        at_ns = now_ns()
        if isinstance(message, FrameHeader):
            self._assembler.header(message)
        elif isinstance(message, FrameChunk):
            complete = self._assembler.chunk(message)
            if complete is not None:
                self._newest = complete[0].frame_id
                self._arrive(_Arrival(complete[0], complete[1], at_ns))
        elif isinstance(message, TimeSyncRequest):
            self._link.send(answer_time_sync(message, at_ns, self._newest))
        elif isinstance(message, Bye):
            self._goodbye, self._ended = True, f"the host ended the session ({message.reason})"
            return False
        elif isinstance(message, ErrorMessage) and message.code != ErrorCode.CORRUPT:
            self._ended = f"the host ended the session: {message.text}"
            return False
        return True

    def _arrive(self, arrival: _Arrival) -> None:
        if self._arrivals.qsize() < self._room:  # only this thread puts in
            self._arrivals.put(arrival)
            return
        frame_id = arrival.header.frame_id
        text = f"frame {frame_id} came while {self._room} others waited: the window is {self._room}"
        self._warn(text)
        self._link.send(ErrorMessage(ErrorCode.BUSY, text, frame_id))

    def _damaged(self, error: PacketError) -> None:
        """A packet was damaged: the frame in work cannot become whole."""
        self._warn(str(error))
        self._assembler.abandon()
        if not self._assembler.has_lost:
            self._link.send(ErrorMessage(ErrorCode.CORRUPT, str(error), NO_FRAME))

    def _mistaken(self, mistake: ProtocolMistake) -> None:
        """The host sent what the protocol does not allow: it alone can mend that."""
        self._warn(str(mistake))
        about = mistake.frame_id
        if about is None:
            self._link.send(ErrorMessage(ErrorCode.OTHER, str(mistake), NO_FRAME))
            return
        if about == self._assembler.frame_id:
            self._assembler.abandon()
        self._link.send(ErrorMessage(ErrorCode.FORMAT, str(mistake), about))

    def _warn(self, sentence: str) -> None:
        self._logged += 1
        if self._logged <= MAX_LOGGED:
            logger.warning(
                "%s%s", sentence, " (further ones are not logged)" if self._logged == MAX_LOGGED else ""
            )

    def _report_lost(self) -> None:
        for frame_id in self._assembler.lost():
            text = f"frame {frame_id} lost a packet on the line"
            self._link.send(ErrorMessage(ErrorCode.INCOMPLETE, text, frame_id))


def _numbers(values: Any) -> Any:  # noqa: ANN401 - any sequence of numbers, or None
    return None if values is None else tuple(float(x) for x in values)
