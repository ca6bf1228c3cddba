"""Commands of the estimator beside the flight."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.command_table import STATE, Argument, Command

if TYPE_CHECKING:
    from flyaround.gui.console import Console


def keep_estimates(console: Console) -> None:
    """Give the estimator the newest picture, and tell what went wrong; once a turn."""
    estimates = console.estimates
    if estimates.update(console.feed.newest):
        accepted = [e for e in estimates.history if e.answer.accepted and e.E_R_deg is not None]
        if len(accepted) == 1 and accepted[0] is estimates.newest:
            first = accepted[0]
            console.say(
                f"{first.method}: first accepted pose, {first.E_R_deg:.2f} deg and {1e3 * (first.E_T_m or 0.0):.0f} mm "
                f"off at {first.range_m:.1f} m"
            )
    for trouble in estimates.take_troubles():
        console.say(trouble, "caution")


COMMANDS = (
    Command(
        "estimator.run",
        "Estimate",
        "run the method on the newest picture, again and again, in a process of its own",
        lambda console, on: console.estimates.start() if on else console.estimates.stop(),
        arguments=(STATE,),
        state=lambda console: console.estimates.on,
    ),
    Command(
        "estimator.method",
        "Method",
        "which estimator: a name of flyaround evaluate, or net:FILE",
        lambda console, method: console.estimates.choose(method),
        arguments=(
            Argument("method", "word", "svd, svd-2018, svd-thesis, svd-track, net:FILE or a package's"),
        ),
    ),
    Command(
        "estimator.stages",
        "Stages as pictures",
        "a picture of each stage with every estimate; it takes about twice as long",
        lambda console, on: console.estimates.want_stages(wanted=on),
        arguments=(STATE,),
        state=lambda console: console.estimates.stages_wanted,
    ),
    Command(
        "estimator.forget",
        "Forget estimates",
        "begin the estimator's plots again",
        lambda console: console.estimates.forget(),
    ),
)
