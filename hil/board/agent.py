"""Board agent: one estimator that serves sessions with hosts."""

from __future__ import annotations

import json
import logging
import math
import platform
import random
import time
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any, Callable, Dict, List, Optional, Tuple, Union

from flyaround.hil.board.answering import BoardEstimator
from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.frame_server import BoardSummary, FrameServer
from flyaround.hil.board.method_names import HYBRID
from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.packets.enums import GREY_FORMATS, format_mask
from flyaround.hil.link.packets.images import check_terms, supported_encodings
from flyaround.hil.link.packets.messages import ErrorCode, ErrorMessage, Hello, HelloAck, PixelFormat
from flyaround.hil.link.packets.packet import PacketType
from flyaround.hil.link.security import prove_to_host
from flyaround.hil.link.session import SILENCE_S, Link, greet_host
from flyaround.hil.link.transports.url import connect, parse_url

logger = logging.getLogger(__name__)

SUFFIX = ".board.json"

# Delay before a new connection attempt [s]: doubled after each failure, up to the second value.
MIN_BACKOFF_S, MAX_BACKOFF_S = 0.1, 1.6

# Makes an estimator from a camera JSON object, which arrives with the handshake.
EstimatorFactory = Callable[[Dict[str, Any]], BoardEstimator]


def estimator_factory(model_path: Union[str, Path], method: str) -> Tuple[EstimatorFactory, str, str]:
    """Return a factory for the estimator called ``method``, and the identity of the target model.

    Returns
    -------
    make : EstimatorFactory
        Makes the estimator from the camera JSON object of the host.
    name : str
        Name of the target model.
    sha256 : str
        Hash of the target model, as hexadecimal digits.

    Raises
    ------
    LinkError
        If the model file, the method or the compiled library cannot be used.
    """
    from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics  # noqa: PLC0415 - needs OpenCV
    from flyaround.hil.board.hybrid.native.library import describe_library, library  # noqa: PLC0415 - needs OpenCV
    from flyaround.hil.board.method_names import WITH_LIBRARY  # noqa: PLC0415 - needs OpenCV
    from flyaround.hil.board.methods import check_method_name, make_estimator  # noqa: PLC0415 - needs OpenCV

    try:
        check_method_name(method)
        logger.info("library of the estimator: %s", describe_library())
        if method in WITH_LIBRARY:
            # fail before connecting to a host
            library()
    except BoardModelError as error:
        raise LinkError(str(error)) from error

    try:
        inside = _read_bundled(str(model_path))
        model = (
            BoardModel.read(str(model_path)) if inside is None else BoardModel.from_dict(json.loads(inside))
        )
    except (OSError, ValueError) as error:
        raise LinkError(f"{error}: write it again on the host and copy it to the board") from error

    def make(camera: Dict[str, Any]) -> BoardEstimator:
        return make_estimator(model, CameraIntrinsics.from_dict(camera), method)

    return make, model.name, model.sha256


def describe_board(model_name: str, model_sha256: str, method: str, *, compiled: bool) -> Hello:
    """Return this board's HELLO message.

    Parameters
    ----------
    model_name : str
        Name of the target model.
    model_sha256 : str
        Hash of the target model.
    method : str
        Name of the estimator.
    compiled : bool
        True for a built-in estimator: the versions of OpenCV and of the compiled kernels are then included.

    Returns
    -------
    Hello
        Message with the board's formats, model and method.
    """
    runs_on = f" {platform.machine()} Python {platform.python_version()}"
    if compiled:
        import cv2  # noqa: PLC0415 - optional: an own estimator may not need OpenCV

        from flyaround.hil.board.hybrid.native.library import describe_library  # noqa: PLC0415 - needs OpenCV

        runs_on += f", OpenCV {cv2.__version__}, {describe_library().split()[0]}"
    return Hello(
        encodings=supported_encodings(),
        model_name=model_name,
        model_sha256=model_sha256,
        method=method,
        takes_fields=True,
        # truncate the host name, not the versions
        board=platform.node()[: max(Hello.BOARD_BYTES - len(runs_on), 0)] + runs_on,
    )


def bundled_models() -> List[str]:
    """Return the names of the board models bundled with this program; a checkout has none."""
    names = [item.name for item in _models().iterdir()] if _models().is_dir() else []
    return sorted(name[: -len(SUFFIX)] for name in names if name.endswith(SUFFIX))


def _read_bundled(name: str) -> Optional[bytes]:
    if Path(name).is_file() or name not in bundled_models():
        return None
    return (_models() / (name + SUFFIX)).read_bytes()


def _models() -> Any:  # noqa: ANN401 - a Path, or a Traversable inside a zip
    return files("flyaround.hil.board").joinpath("models")


class BoardAgent:
    """Agent that serves sessions with hosts, one after another, with a single estimator and target model.

    Parameters
    ----------
    url : str
        URL of the host.
    model_path : str or Path, optional
        Board model file, or the name of a bundled one; unused with ``make_estimator``.
    method : str, optional
        Name of the estimator; unused with ``make_estimator``.
    make_estimator : EstimatorFactory, optional
        Called once per session with the camera as a dict (``fx_px``, ``cx_px``, ...); returns the estimator.
    model_name : str, optional
        Name of the target that ``make_estimator`` is for.
    model_sha256 : str, optional
        Hash of that target's model, which the host compares with its own.
    connect_timeout_s : float, optional
        Time-out of the connection, and of the host's first message.
    window : int, optional
        Number of frames held at once, including the one being processed.
    key : bytes, optional
        Pre-shared key for mutual authentication; None disables authentication.
    watchdog_s : float, optional
        Longest processing time of a frame; the session ends if it is exceeded. Infinite by default.
    silence_s : float, optional
        Time without messages after which the host is considered lost.
    takes_colour : bool, optional
        True if the estimator also accepts (H, W, 3) images.

    Raises
    ------
    LinkError
        If the URL, the model, the method or the kernels cannot be used, or the window or a time is not positive; the
        message is one sentence.
    """

    def __init__(
        self,
        url: str,
        model_path: Union[str, Path, None] = None,
        method: str = HYBRID,
        *,
        make_estimator: Optional[EstimatorFactory] = None,
        model_name: str = "",
        model_sha256: str = "",
        connect_timeout_s: float = 60.0,
        window: int = 2,
        key: Optional[bytes] = None,
        watchdog_s: float = math.inf,
        silence_s: float = SILENCE_S,
        takes_colour: bool = False,
    ) -> None:
        parse_url(url)
        limits = {"window": window, "watchdog_s": watchdog_s, "silence_s": silence_s}
        for name, value in limits.items():
            # the negated test also refuses NaN, a limit that nothing exceeds
            if not value > 0:
                raise LinkError(f"the board's {name} is {value}: give more than 0")
        compiled = make_estimator is None
        if make_estimator is None:
            if model_path is None:
                raise LinkError("the board needs a model file: name one with --model")
            make_estimator, model_name, model_sha256 = estimator_factory(model_path, method)
        self._url, self._make, self._key = url, make_estimator, key
        self._timeout_s, self._watchdog_s, self._silence_s = connect_timeout_s, watchdog_s, silence_s
        self._server: Optional[FrameServer] = None
        hello = describe_board(model_name, model_sha256, method, compiled=compiled)
        formats = format_mask(PixelFormat if takes_colour else GREY_FORMATS)
        self._hello = replace(hello, window=window, pixel_formats=formats)

    @property
    def is_responsive(self) -> bool:
        """True unless a frame has taken twice the watchdog time; a supervisor restarts the program if False."""
        server = self._server
        return server is None or server.overdue_s < self._watchdog_s

    def serve(self) -> BoardSummary:
        """Serve one session with a host to its end.

        Raises
        ------
        LinkError
            If the host cannot be reached or refuses, or its image format is not supported; the message is one sentence.
        """
        line = connect(self._url, self._timeout_s)
        try:
            link = Link(line if self._key is None else prove_to_host(line, self._key, self._timeout_s))
        except LinkError:
            line.close()
            raise
        goodbye = "the board's agent ends"
        try:
            repeat_s = 1.0 if self._url.startswith("serial") else math.inf
            terms = greet_host(link, self._hello, self._timeout_s, repeat_s=repeat_s)
            # the board must not see ground truth, so it does not decode it
            link.accepts = link.accepts - {PacketType.TRUTH}
            estimator = self._estimator(terms, link)
            logger.info("session with %s: %d x %d px", self._url, terms.width_px, terms.height_px)
            self._server = FrameServer(
                link,
                terms,
                estimator,
                self._hello.window,
                watchdog_s=self._watchdog_s,
                silence_s=self._silence_s,
            )
            summary = self._server.run()
            if summary.hung:
                goodbye = summary.ended
            return summary
        finally:
            self._server = None
            link.close(goodbye)

    def serve_repeatedly(
        self,
        report: Callable[[str], None] = logger.info,
        pause: Callable[[float], None] = time.sleep,
    ) -> BoardSummary:
        """Serve one session after another, whatever the outcome; only a hung estimator ends this.

        Answers never cross sessions: those of a session that ended are discarded.

        Parameters
        ----------
        report : callable, optional
            Receives a sentence about the end of each session, and about each new reason why none could start.
        pause : callable, optional
            Sleeps for a number of seconds; the back-off doubles up to a bound and is reset by a session.

        Returns
        -------
        BoardSummary
            Summary of the session whose estimator hung; only a new process gets rid of the hung thread.
        """
        wait_s, reported = MIN_BACKOFF_S, ""
        while True:
            try:
                summary = self.serve()
            except LinkError as error:
                sentence = str(error)
                if sentence != reported:
                    report(f"{sentence}; trying again")
                reported = sentence
            else:
                report(summary.ended)
                if summary.hung or summary.busy:
                    return summary
                wait_s, reported = MIN_BACKOFF_S, ""
            # random jitter, so that boards that lost the same host do not all reconnect at once
            pause(wait_s * random.uniform(0.75, 1.25))
            wait_s = min(2.0 * wait_s, MAX_BACKOFF_S)

    def _estimator(self, terms: HelloAck, link: Link) -> BoardEstimator:
        try:
            check_terms(terms, self._hello.encodings, self._hello.pixel_formats)
            return self._make(terms.camera)
        except Exception as error:
            if isinstance(error, (BoardModelError, LinkError, ValueError)):
                sentence = f"the board cannot use the host's camera ({error}): check the scenario's camera"
            else:
                sentence = f"the board's estimator cannot start ({type(error).__name__}: {error}): mend make_estimator"
            link.send(ErrorMessage(ErrorCode.FORMAT, sentence))
            raise LinkError(sentence) from error


def run_board(
    url: str,
    model_path: Union[str, Path, None] = None,
    method: str = HYBRID,
    **options: Any,  # noqa: ANN401 - those of BoardAgent
) -> BoardSummary:
    """Serve one session with a host, to its end.

    Parameters
    ----------
    url : str
        URL of the host.
    model_path : str or Path, optional
        Board model file, or the name of a bundled one; unused with ``make_estimator``.
    method : str, optional
        Name of the estimator.
    options : object
        Further parameters of `BoardAgent`.

    Returns
    -------
    BoardSummary
        Counts of the session, and how it ended.

    Raises
    ------
    LinkError
        If the host cannot be reached or refuses, or the model cannot be used; the message is one sentence.
    """
    return BoardAgent(url, model_path, method, **options).serve()
