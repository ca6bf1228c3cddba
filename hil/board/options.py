"""Options of a board's agent: one table for ``board.pyz`` and ``flyaround hil board``, and the agent made of it."""

from __future__ import annotations

import argparse
import math
from typing import Any, Dict, NamedTuple, Optional, Tuple

from flyaround.hil.board.agent import BoardAgent, EstimatorFactory
from flyaround.hil.board.method_names import HYBRID
from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.security import read_key
from flyaround.hil.link.session import SILENCE_S

MAX_WINDOW = 64


class AgentOption(NamedTuple):
    """Option of the command line, for any of the programs.

    Parameters
    ----------
    flag : str
        Option as typed.
    kind : type
        Str, int, float, or bool for one without a value.
    default : object
        None if it has none.
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
        "Estimator: hybrid (ours, the default), hybrid-track (the same, following a sequence), svd-2018 or svd-thesis"
        " (the published algorithm), or net:FILE of flyaround train.",
    ),
    AgentOption(
        "--timeout", float, 60.0, "Seconds to try to reach the host, and to wait for its first word.", "S"
    ),
    AgentOption("--key", str, None, "File with the key that the host asks for.", "FILE"),
    AgentOption("--window", int, 2, "Frames held at once, the one in work included.", "N"),
    AgentOption("--reconnect", bool, False, "After a session meet the next host, until stopped."),
    AgentOption(
        "--watchdog",
        float,
        None,
        "Decline a frame that the estimator does not come back from for S seconds, and end with code 3;"
        " with --reconnect start anew.",
        "S",
    ),
    AgentOption("--silence", float, SILENCE_S, "Take a host that says nothing for S seconds for gone.", "S"),
)


def add_options(parser: argparse._ActionsContainer, table: Tuple[AgentOption, ...] = AGENT_OPTIONS) -> None:
    """Add a table of options to a parser of the standard library or to a group of it."""
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
    given: Dict[str, Any],
    own: Optional[Tuple[EstimatorFactory, str, str]] = None,
) -> BoardAgent:
    """Return the agent that the options describe.

    Parameters
    ----------
    url : str
        The host's.
    model_path : str
        Board model file, or a bundled one's name.
    given : dict of str to object
        Values by `AgentOption.name`.
    own : tuple of EstimatorFactory and str, optional
        Another estimator than those of the board by name: its factory, and name and hash of its model.

    Raises
    ------
    LinkError
        If a value, the URL, the model, the method, the key or the kernels cannot be used; the message is one sentence.
    """
    for name in ("timeout", "watchdog", "silence"):
        if given[name] is not None and not given[name] > 0:
            raise LinkError(f"--{name} {given[name]:g} cannot be: give seconds above 0")
    if not 1 <= given["window"] <= MAX_WINDOW:
        raise LinkError(f"--window {given['window']} cannot be: give 1 to {MAX_WINDOW} frames")
    names = ("make_estimator", "model_name", "model_sha256")
    more: Dict[str, Any] = {} if own is None else dict(zip(names, own))  # noqa: B905 - Python 3.9 has no strict=
    return BoardAgent(
        url,
        model_path,
        given["method"],
        connect_timeout_s=given["timeout"],
        window=given["window"],
        key=None if given["key"] is None else read_key(given["key"]),
        watchdog_s=math.inf if given["watchdog"] is None else given["watchdog"],
        silence_s=given["silence"],
        **more,
    )
