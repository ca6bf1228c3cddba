"""Writing a scenario as the TOML file that replays a recorded flight."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import msgspec

from flyaround.simulator.scenario.messages import known_orbit
from flyaround.simulator.world.flight.recording import Replay

if TYPE_CHECKING:
    from flyaround.simulator.scenario.scenario import Scenario


def replay_scenario(scenario: Scenario, recording_file: str, duration_s: float | None = None) -> str:
    """TOML of a scenario like this one whose chaser and target fly as recorded.

    Parameters
    ----------
    scenario : what was flown. recording_file : path from where the TOML will lie.
    duration_s : of the recording, when it is not the scenario's.
    """
    chaser = Replay(file=recording_file, minimum_start_range_m=scenario.chaser.minimum_start_range_m)
    replay = msgspec.structs.replace(
        scenario,
        name=f"{scenario.name}-replay",
        chaser=chaser,
        orbit=known_orbit(scenario),
        # the recording has flown them
        burns=[],
        duration_s=duration_s or scenario.duration_s,
    )
    return to_toml(msgspec.to_builtins(replay))


def to_toml(table: dict[str, Any], path: str = "") -> str:
    """A nested table as TOML; keys without a value are left out."""
    nested = {k: v for k, v in table.items() if isinstance(v, dict) or _is_tables(v)}
    plain = {k: v for k, v in table.items() if v is not None and k not in nested}
    text = "".join(f"{key} = {toml_value(value)}\n" for key, value in plain.items())
    for key, value in nested.items():
        name = f"{path}.{key}" if path else key
        if isinstance(value, dict):
            text += f"\n[{name}]\n{to_toml(value, name)}"
        else:
            text += "".join(f"\n[[{name}]]\n{to_toml(item, name)}" for item in value)
    return text


def _is_tables(value: Any) -> bool:  # noqa: ANN401 - a TOML value is anything
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(v, dict) for v in value)


def toml_value(value: Any) -> str:  # noqa: ANN401 - a TOML value is anything
    """A value as TOML writes it."""
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    if isinstance(value, float):
        return repr(value)
    if not isinstance(value, str):
        return json.dumps(value)
    # JSON writes texts as TOML does, but for pairs of surrogates and for DEL
    text = value.encode(errors="replace").decode()
    return json.dumps(text, ensure_ascii=max(text, default="") <= "\uffff").replace("\x7f", "\\u007f")
