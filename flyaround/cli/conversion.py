"""convert: other data sets to the native format, and the native format to others."""

from __future__ import annotations

from pathlib import Path

from flyaround.cli.run_options import with_run_options
from flyaround.cli.terminal import progress_bar, say
from flyaround.runs.conversion import ConvertRun
from flyaround.runs.document import write_run
from flyaround.simulator.dataset.conversion import convert as convert_dataset
from flyaround.simulator.dataset.conversion import open_source
from flyaround.simulator.dataset.split import parse_split


@with_run_options
def convert(run: ConvertRun) -> None:
    """Write a data set in another format; those with poses only get masks, keypoints and boxes from the model."""
    shares = None if run.split is None else parse_split(run.split)
    opened = open_source(Path(run.source), run.source_format, target=run.target, camera=run.camera)
    output = Path(run.output)
    with progress_bar("convert") as progress:
        count = convert_dataset(
            opened,
            output,
            run.form,
            split=shares,
            progress=progress,
            tell=lambda sentence: say(sentence, stderr=True),
        )
    write_run(output, run)
    card = opened.card
    say(
        f"{count} frames of {card.scenario_name} ({opened.form}, {card.target.name}) written to {output} as {run.form}"
    )
