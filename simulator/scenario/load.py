"""Reading scenarios: built-in names and TOML files, every mistake in one sentence."""

from __future__ import annotations

import datetime as dt
import re
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from flyaround.simulator.camera.detector.limits import optics_problem, response_problem, sensor_problem
from flyaround.simulator.camera.lens.files import CameraFile, read_camera_file
from flyaround.simulator.errors import UserError, near_names
from flyaround.simulator.runtime.toml_file import MOST_TOML_BYTES, parse_toml
from flyaround.simulator.runtime.untrusted_files import read_regular
from flyaround.simulator.runtime.validation_errors import explain
from flyaround.simulator.scenario.checks import check_physics
from flyaround.simulator.scenario.faults import check_times
from flyaround.simulator.scenario.messages import resolve_messages
from flyaround.simulator.scenario.scenario import Scenario
from flyaround.simulator.scene.environments import ENVIRONMENTS
from flyaround.simulator.world.time.instant import Instant

if TYPE_CHECKING:
    from flyaround.simulator.camera.detector.optics import Optics
    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.scene.illumination.bands import Bands


def list_scenarios() -> tuple[str, ...]:
    """Names of the built-in scenarios."""
    folder = files("flyaround.assets").joinpath("scenarios")
    return tuple(sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")))


def load_scenario(name_or_path: str | Path) -> Scenario:
    """A scenario by its built-in name or from a TOML file.

    Raises
    ------
    UserError
        If there is none, or the file has a mistake: file, key, value given and what is allowed.
    """
    text, content = str(name_or_path), scenario_source(name_or_path)
    if text in list_scenarios():
        return parse_scenario(content, f"built-in scenario {text}", text, Path())
    path = Path(name_or_path)
    return parse_scenario(content, text, path.stem, path.parent)


def scenario_source(name_or_path: str | Path) -> bytes:
    """Return the contents of a scenario's file, built-in or a user's.

    Raises
    ------
    UserError
        If there is none, or it cannot be read.
    """
    text, path = str(name_or_path), Path(name_or_path)
    if text in list_scenarios():
        return files("flyaround.assets").joinpath("scenarios", f"{text}.toml").read_bytes()
    try:
        if not path.is_file():
            raise UserError(_no_such_scenario(text, path))
        return read_regular(path, MOST_TOML_BYTES)
    except OSError as error:
        raise UserError(f"{text} cannot be read: {error.strerror or error}") from error


def scenario_json_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of the scenario file."""
    schema = msgspec.json.schema(Scenario)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Flyaround scenario, version 1",
        **schema,
    }


def toml_table(content: bytes, where: str) -> dict[str, Any]:
    """A TOML file as msgspec takes it, the layers of its environment's preset filled in.

    Raises
    ------
    UserError
        If it is no TOML, or has a value that no file of ours has.
    """
    return _with_preset_layers(_toml_values(parse_toml(content, where), where, ""))


def parse_scenario(content: bytes, where: str, stem: str, folder: Path) -> Scenario:
    """A scenario from a file's contents.

    Parameters
    ----------
    where : what messages call it. stem : its name if it has none. folder : of the files that it names.

    Raises
    ------
    UserError
        If it has a mistake: key, value given and what is allowed.
    """
    raw = toml_table(content, where)
    try:
        scenario = msgspec.convert(raw, Scenario)
    except msgspec.ValidationError as error:
        raise UserError(f"{where}: {explain(str(error), raw, Scenario)}") from error
    try:
        Instant.from_utc(scenario.epoch_utc)
    except ValueError as error:
        raise UserError(f"{where}: key epoch_utc: {error}") from error
    scenario = msgspec.structs.replace(
        scenario,
        name=scenario.name or stem,
        camera=resolve_camera(scenario.camera, where, folder),
        optics=scenario.optics.with_kernel(folder, where),
    )
    scenario.camera_model  # noqa: B018 - raises where the region or the binning does not fit
    check_detector(scenario.sensor_model, scenario.optics_model, scenario.output.bands, where)
    scenario = _with_one_mass(scenario, raw, where)
    scenario = resolve_messages(scenario, where, folder)
    check_physics(scenario, where)
    if scenario.faults is not None:
        check_times(scenario.faults, where)
    return scenario


def _with_one_mass(scenario: Scenario, raw: dict[str, Any], where: str) -> Scenario:
    """The scenario whose thrusters push the mass that air and sunlight do, where the file gives it for these alone."""
    thrusters, mass_kg = scenario.chaser.acting_thrusters, scenario.forces.chaser.mass_kg
    if thrusters is None or mass_kg is None or thrusters.mass_kg == mass_kg:
        return scenario
    if "mass_kg" in raw["chaser"].get("thrusters", {}):
        raise UserError(
            f"{where}: key chaser.thrusters.mass_kg is {thrusters.mass_kg:g} and forces.chaser.mass_kg {mass_kg:g}, "
            "allowed: one mass of the chaser: remove one of them"
        )
    weighed = msgspec.structs.replace(thrusters, mass_kg=mass_kg)
    chaser = msgspec.structs.replace(scenario.chaser, thrusters=weighed)
    return msgspec.structs.replace(scenario, chaser=chaser)


def _with_preset_layers(raw: dict[str, Any]) -> dict[str, Any]:
    """The file with the layers of its environment's preset filled in; an unknown preset is left to the validation."""
    section = raw.get("environment")
    if not isinstance(section, dict) or section.get("preset") not in ENVIRONMENTS:
        return raw
    return {**raw, "environment": {**msgspec.structs.asdict(ENVIRONMENTS[section["preset"]]), **section}}


def resolve_camera(camera: str | CameraFile, where: str, folder: Path) -> CameraFile:
    """The camera of a file: a built-in name, a path beside the file, or the table itself.

    Raises
    ------
    UserError
        If there is none, or it cannot be.
    """
    if isinstance(camera, CameraFile):
        found = camera
    else:
        try:
            found = read_camera_file(camera, folder)
        except UserError as error:
            raise UserError(f"{where}: key camera: {error}") from error
        if not found.name:
            found = msgspec.structs.replace(found, name=Path(camera).stem)
    found.camera(f"{where}: camera")
    return found


def check_detector(sensor: Sensor, optics: Optics, bands: Bands, where: str) -> None:
    """Refuse a lens or detector that cannot be.

    Raises
    ------
    UserError
        With the key, its value and what is allowed.
    """
    problem = (
        optics_problem(optics)
        or sensor_problem(sensor)
        or response_problem(sensor, optics, 1 if bands == "mono" else 3)
    )
    if problem is not None:
        raise UserError(f"{where}: key {problem}")
    detector = sensor.detector
    if detector is not None and detector.colour_filter != "none" and bands == "mono":
        raise UserError(
            f"{where}: key sensor.detector.colour_filter is {detector.colour_filter!r}, which needs "
            'output.bands = "rgb"'
        )


def _toml_values(value: Any, where: str, key: str) -> Any:  # noqa: ANN401 - a TOML value is anything
    """Convert TOML values for msgspec: a time becomes text in UTC."""
    if isinstance(value, dict):
        return {k: _toml_values(v, where, f"{key}.{k}" if key else k) for k, v in value.items()}
    if isinstance(value, list):
        return [_toml_values(v, where, f"{key}[{i}]") for i, v in enumerate(value)]
    if isinstance(value, dt.datetime):
        if value.tzinfo is None:
            raise UserError(
                f"{where}: key {key} is {value.isoformat()}, which names no time zone: end it with Z"
            )
        utc = value.astimezone(dt.UTC).replace(tzinfo=None)
        return utc.isoformat() + "Z"
    return value


def _no_such_scenario(text: str, path: Path) -> str:
    names = list_scenarios()
    if path.suffix == ".toml" or re.search(r"[/\\]", text):
        return f"there is no scenario file {text!r}: give a TOML file, or one of {', '.join(names)}"
    near = near_names(text, names, 3)
    hint = f"did you mean {' or '.join(near)}?" if near else f"built-in ones are {', '.join(names)}"
    return f"there is no scenario {text!r}: {hint}"
