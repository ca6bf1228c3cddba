"""hil board: the board's side on this machine, with the options of the bundle's agent."""

from __future__ import annotations

import inspect
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flyaround.cli.estimation import check_method
from flyaround.cli.terminal import say
from flyaround.hil.board.agent import EstimatorFactory, describe_board, svd_factory
from flyaround.hil.board.answering import BoardEstimator
from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.gige.camera import SCHEME
from flyaround.hil.board.gige.camera_board import run_camera_board
from flyaround.hil.board.gige.options import CAMERA_OPTIONS, TITLE, camera_board_options, check_options
from flyaround.hil.board.options import AGENT_OPTIONS, make_agent
from flyaround.hil.board.service import ExitCode
from flyaround.hil.board.serving import NoSessionError, exit_at_once, exit_code, serve_sessions
from flyaround.hil.board_model.write import write_board_model
from flyaround.hil.evaluate.added_estimators import any_estimator
from flyaround.hil.evaluate.method_choice import MethodChoice
from flyaround.simulator.runtime.plugins import plugins
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.hil.board.frame_server import BoardSummary


def with_agent_options(command: Callable[..., None]) -> Callable[..., None]:
    """The command with the tables' options in place of its ``**given``."""
    signature = inspect.signature(command, eval_str=True)
    own = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
    table = [
        inspect.Parameter(
            option.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=option.default,
            annotation=Annotated[
                option.kind if option.default is not None else option.kind | None,
                typer.Option(
                    option.flag, help=option.text, metavar=option.unit or None, rich_help_panel=panel
                ),
            ],
        )
        for panel, options in ((None, AGENT_OPTIONS), (TITLE, CAMERA_OPTIONS))
        for option in options
    ]
    command.__annotations__ = {p.name: p.annotation for p in (*own, *table)}
    vars(command)["__signature__"] = signature.replace(parameters=[*own, *table])
    return command


@with_agent_options
def board(
    url: Annotated[
        str,
        typer.Argument(
            help="The host: tcp://HOST:PORT or serial:///DEVICE?baud=N; or a camera: gige://ADDRESS."
        ),
    ],
    target: Annotated[str, typer.Option(help="Target name.")] = "tango",
    **given: Any,  # noqa: ANN401 - the tables'
) -> None:
    """The board's side, on this machine: connect, estimate, answer; the exit code tells how it ended.

    The URL is the host's address, such as tcp://192.168.1.10:5600, or this end of a serial line, such as
    serial:///dev/ttyUSB0?baud=921600. Exit code 0: the host said goodbye; 1: it vanished; 2: a mistake in what was
    given; 3: the watchdog stopped the estimator; 4: no session could be had.

    With gige://ADDRESS the board reads a camera on the network through Aravis: that of hil camera, or a real one. A
    camera takes no poses: they are written to a file, and sent to a host by --answer.
    """
    check_options(url, given)
    check_method(given["method"])
    with TemporaryDirectory() as folder:  # read once, and not needed any more
        path = Path(folder) / f"{target}.board.json"
        write_board_model(load_target(target), path)
        own = added_factory(path, given["method"]) if given["method"] in plugins("estimator") else None
        if url.startswith(SCHEME):
            make, name, sha256 = own or svd_factory(path, given["method"])
        else:
            agent = make_agent(url, str(path), given, own)
    if url.startswith(SCHEME):
        hello = describe_board(name, sha256, given["method"], compiled=True)
        _told(run_camera_board(url, camera_board_options(given), make, hello))
        return
    try:
        summary = serve_sessions(agent, reconnect=given["reconnect"], start=[])
    except NoSessionError as error:
        say(f"flyaround: {error}", stderr=True)
        raise typer.Exit(ExitCode.NO_SESSION) from error
    _told(summary)


def added_factory(model_path: Path, method: str) -> tuple[EstimatorFactory, str, str]:
    """An estimator of another package on a model file, as ``svd_factory`` gives one of the board's."""
    model = BoardModel.read(model_path)

    def make(camera: dict[str, Any]) -> BoardEstimator:
        return any_estimator(model, CameraIntrinsics.from_dict(camera), MethodChoice(method))

    return make, model.name, model.sha256


def _told(summary: BoardSummary) -> None:
    """How it ended, in a sentence and by the exit code."""
    say(f"{summary.frames} frames, {summary.accepted} accepted: {summary.ended}", stderr=True)
    if summary.hung:
        exit_at_once(ExitCode.WATCHDOG)
    if exit_code(summary):
        raise typer.Exit(exit_code(summary))
