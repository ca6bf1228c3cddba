"""Commands of the estimator beside the flight."""

from __future__ import annotations

from flyaround.gui.command_table import Command, switch, word

COMMANDS = (
    switch(
        "estimator.run",
        "Estimate",
        "run the method on the newest picture, again and again, in a process of its own",
        lambda console, on: console.jobs.estimates.start() if on else console.jobs.estimates.stop(),
        lambda console: console.jobs.estimates.on,
    ),
    Command(
        "estimator.method",
        "Method",
        "which estimator: a name of flyaround evaluate, or net:FILE",
        lambda console, method: console.jobs.estimates.choose(method),
        arguments=(word("method", "hybrid, svd-2018, svd-thesis, hybrid-track, net:FILE or a package's"),),
    ),
    switch(
        "estimator.stages",
        "Stages as pictures",
        "a picture of each stage with every estimate; it takes about twice as long",
        lambda console, on: console.jobs.estimates.want_stages(wanted=on),
        lambda console: console.jobs.estimates.stages_wanted,
    ),
    Command(
        "estimator.forget",
        "Forget estimates",
        "begin the estimator's plots again",
        lambda console: console.jobs.estimates.forget(),
    ),
)
