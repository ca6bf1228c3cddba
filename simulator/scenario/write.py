"""Writes the scenario file that replays a recorded flight."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from flyaround.simulator.runtime.toml_text import to_toml
from flyaround.simulator.scenario.messages import orbit_at_epoch
from flyaround.simulator.world.flight.recording import Replay
from flyaround.simulator.world.guidance.paths import approach_axis_lvlh

if TYPE_CHECKING:
    from flyaround.simulator.scenario.scenario import Scenario
    from flyaround.simulator.world.guidance.keep_out import Guard


def replay_scenario(
    scenario: Scenario, recording_file: str, duration_s: float | None = None, guard: Guard | None = None
) -> str:
    """Return the TOML of a scenario like this one whose chaser and target follow the recording.

    Parameters
    ----------
    scenario : Scenario
        Scenario flown.
    recording_file : str
        Path relative to the TOML file.
    duration_s : float, optional
        Duration of the recording if it differs from the scenario's.
    guard : str, optional
        The pilot's choice of the keep-out sphere if it differs from the scenario's.

    Returns
    -------
    str
        TOML text.
    """
    flown = scenario.chaser
    keep_out = flown.keep_out
    if keep_out is not None and guard is not None:
        keep_out = msgspec.structs.replace(keep_out, pilot_choice=guard)
    chaser = Replay(
        file=recording_file,
        keep_out=keep_out,
        minimum_start_range_m=flown.minimum_start_range_m,
        approach_axis_lvlh=flown.approach_axis_lvlh
        if isinstance(flown, Replay)
        else approach_axis_lvlh(flown),
    )
    replay = msgspec.structs.replace(
        scenario,
        name=f"{scenario.name}-replay",
        chaser=chaser,
        orbit=orbit_at_epoch(scenario),
        # the recording has flown them
        burns=[],
        duration_s=scenario.duration_s if duration_s is None else duration_s,
    )
    return to_toml(msgspec.to_builtins(replay))
