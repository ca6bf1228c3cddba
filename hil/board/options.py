"""Command-line options of the board agent, shared by ``board.pyz`` and ``flyaround hil board``."""

from __future__ import annotations

import argparse
import math
from typing import Any, Dict, NamedTuple, Optional, Tuple

from flyaround.hil.board.agent import BoardAgent, EstimatorFactory
from flyaround.hil.board.method_names import HYBRID
from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.security import read_key
from flyaround.hil.link.session import SILENCE_S

# Maximum number of frames in flight that a board may request.
MAX_WINDOW = 64


class AgentOption(NamedTuple):
    """Command-line option, independent of the parser.

    Parameters
    ----------
    flag : str
        Option as typed.
    kind : type
        ``str``, ``int`` or ``float``; ``bool`` for a flag without a value.
    default : object
        Default value, or None.
    text : str
        Help text.
    unit : str, optional
        Placeholder of the value in help.
    """

    flag: str
    kind: type
    default: Any
    text: str
    unit: str = ""

    @property
    def name(self) -> str:
        """Name as a function argument."""
        return self.flag[2:].replace("-", "_")


AGENT_OPTIONS: Tuple[AgentOption, ...] = (
    AgentOption(
        "--method",
        str,
        HYBRID,
        "Estimator: hybrid (default), hybrid-track (hybrid, tracking over a sequence), svd-2018 or svd-thesis"
        " (the published algorithm), or net:FILE of flyaround train.",
    ),
    AgentOption(
        "--timeout", float, 60.0, "Seconds to try to reach the host, and to wait for its first message.", "S"
    ),
    AgentOption("--key", str, None, "File with the key shared with the host.", "FILE"),
    AgentOption("--window", int, 2, "Frames held at once, including the one being processed.", "N"),
    AgentOption("--reconnect", bool, False, "Reconnect after each session, until stopped."),
    AgentOption(
        "--watchdog",
        float,
        None,
        "Decline a frame that takes the estimator longer than S seconds, and exit with code 3;"
        " with --reconnect, restart instead.",
        "S",
    ),
    AgentOption("--silence", float, SILENCE_S, "Consider a host lost after S seconds of silence.", "S"),
)


def add_options(parser: argparse._ActionsContainer, table: Tuple[AgentOption, ...] = AGENT_OPTIONS) -> None:
    """Add a table of options to an argparse parser or argument group."""
    for option in table:
        if option.kind is bool:
            parser.add_argument(option.flag, action="store_true", help=option.text)
            continue
        default = "" if option.default is None else f" (default: {option.default})"
        parser.add_argument(
            option.flag,
            type=option.kind,
            default=option.default,
            metavar=option.unit or option.name.upper(),
            help=option.text + default,
        )


def make_agent(
    url: str,
    model_path: str,
    values: Dict[str, Any],
    custom: Optional[Tuple[EstimatorFactory, str, str]] = None,
) -> BoardAgent:
    """Return the agent that a set of option values describes.

    Parameters
    ----------
    url : str
        URL of the host.
    model_path : str
        Board model file, or the name of a bundled one.
    values : dict of str to object
        Option values by `AgentOption.name`.
    custom : tuple of EstimatorFactory and str, optional
        Another estimator than the built-in ones: its factory, and the name and hash of its model.

    Returns
    -------
    BoardAgent
        Agent that has not connected yet.

    Raises
    ------
    LinkError
        If a value, the URL, the model, the method, the key or the kernels cannot be used; the message is one sentence.
    """
    for name in ("timeout", "watchdog", "silence"):
        if values[name] is not None and not values[name] > 0:
            raise LinkError(f"--{name} {values[name]:g} is invalid: give seconds above 0")
    if not 1 <= values["window"] <= MAX_WINDOW:
        raise LinkError(f"--window {values['window']} is invalid: give 1 to {MAX_WINDOW} frames")
    names = ("make_estimator", "model_name", "model_sha256")
    more: Dict[str, Any] = {} if custom is None else dict(zip(names, custom))  # noqa: B905 - Python 3.9 has no strict=
    return BoardAgent(
        url,
        model_path,
        values["method"],
        connect_timeout_s=values["timeout"],
        window=values["window"],
        key=None if values["key"] is None else read_key(values["key"]),
        watchdog_s=math.inf if values["watchdog"] is None else values["watchdog"],
        silence_s=values["silence"],
        **more,
    )
