"""Loader of scenarios, recipes and ranges, by built-in name or from TOML files."""

from __future__ import annotations

import datetime as dt
import re
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import msgspec

from flyaround.simulator.camera.detector.limits import (
    focus_problem,
    optics_problem,
    response_problem,
    sensor_problem,
)
from flyaround.simulator.camera.lens.files import CameraFile, read_camera_file
from flyaround.simulator.errors import UserError, near_names
from flyaround.simulator.runtime.plugins import plugins
from flyaround.simulator.runtime.toml_file import MAX_TOML_BYTES, parse_toml, read_toml
from flyaround.simulator.runtime.untrusted_files import find_beside, read_regular
from flyaround.simulator.runtime.validation_errors import convert_document
from flyaround.simulator.scenario.checks import check_document, raise_first_problem, reversed_intervals
from flyaround.simulator.scenario.faults import check_times
from flyaround.simulator.scenario.messages import resolve_messages
from flyaround.simulator.scenario.recipe import PoseList, Recipe
from flyaround.simulator.scenario.scenario import Scenario
from flyaround.simulator.scenario.vary import Vary
from flyaround.simulator.scene.environments import ENVIRONMENTS
from flyaround.simulator.targets.library import list_targets
from flyaround.simulator.world.time.instant import Instant

if TYPE_CHECKING:
    from collections.abc import Iterator

    from flyaround.simulator.scenario.recipe import AnyPoses

Kind = Literal["scenario", "recipe"]
_Document = TypeVar("_Document", Scenario, Recipe)

_RECIPE_SCHEMA = re.compile(rb"^\s*schema\s*=\s*[\"']flyaround\.recipe[\"']", re.MULTILINE)

# Maximum number of recipes that stand on each other, which ends a circle.
MAX_BASES = 8

TARGET_RECIPE = "eval-black"
"""Recipe whose name may be followed by a target: eval-black-dragon is eval-black with --target dragon."""

_NOT_INHERITED = ("base", "name", "members")


def list_scenarios() -> tuple[str, ...]:
    """Return the names of the built-in scenarios.

    Returns
    -------
    tuple of str
        Names that `load_scenario` accepts.
    """
    return _built_in_names("scenario")


def list_recipes() -> tuple[str, ...]:
    """Return the names of the built-in recipes, then of those that other packages add.

    Returns
    -------
    tuple of str
        Names that `load_recipe` accepts.
    """
    built_in = _built_in_names("recipe")
    return (*built_in, *(name for name in plugins("recipe") if name not in built_in))


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Load a scenario by its built-in name or from a TOML file.

    Returns
    -------
    Scenario
        Checked scenario.

    Raises
    ------
    UserError
        If it is missing, or has a mistake: file, key, value and allowed values.
    """
    return parse_scenario(scenario_source(name_or_path), *_origin("scenario", name_or_path))


def built_in_name(scenario: Scenario) -> str:
    """Return the name of a built-in scenario; empty for another one, also of the same name.

    Returns
    -------
    str
        Name that `load_scenario` accepts, or an empty text.
    """
    name = scenario.name
    return name if name in list_scenarios() and load_scenario(name) == scenario else ""


def load_recipe(name_or_path: str | Path) -> Recipe:
    """Load a recipe by its built-in name or from a TOML file, with the sections of its base.

    Returns
    -------
    Recipe
        Checked recipe.

    Raises
    ------
    UserError
        If it is missing, or has a mistake: file, key, value and allowed values.
    """
    text = str(name_or_path)
    if (target := target_in(text)) is not None:
        recipe = load_recipe(TARGET_RECIPE)
        return msgspec.structs.replace(recipe, name=text, title=f"{recipe.title}, of {target}", target=target)
    source, stem, folder = _origin("recipe", name_or_path)
    raw = _with_base(toml_table(_source("recipe", name_or_path), source), source, folder)
    recipe = _resolve(convert_document(raw, Recipe, source), source, stem, folder)
    recipe = msgspec.structs.replace(recipe, poses=_resolve_pose_file(recipe.poses, source, folder))
    check_document(recipe, source)
    return recipe


def load_vary(path: str | Path, own: Vary | None = None) -> Vary:
    """Load ranges from a TOML file.

    Parameters
    ----------
    path : str or Path
        File to read.
    own : Vary, optional
        Ranges of the recipe, used for keys that are missing in the file.

    Returns
    -------
    Vary
        Checked ranges.

    Raises
    ------
    UserError
        If it cannot be read, or has a mistake: key, value and allowed values.
    """
    source = str(path)
    raw = toml_table(read_toml(Path(path), f"--vary {source}", "give a TOML file of ranges"), source)
    vary = convert_document(raw, Vary, source)
    if own is not None:
        vary = msgspec.convert(_merge(msgspec.to_builtins(own), raw), Vary)
    raise_first_problem(reversed_intervals(vary), source)
    return vary


def is_recipe(name_or_path: str) -> bool:
    """Return True if a name is that of a built-in recipe or of a recipe file.

    Returns
    -------
    bool
        False also if there is no such file, or it cannot be read. Its contents are searched for the key ``schema``
        of a recipe but not checked.
    """
    if name_or_path in list_recipes() or target_in(name_or_path) is not None:
        return True
    path = Path(name_or_path)
    try:
        return path.is_file() and _RECIPE_SCHEMA.search(read_regular(path, MAX_TOML_BYTES)) is not None
    except (OSError, UserError):
        return False


def target_in(name: str) -> str | None:
    """Return the target in a name such as eval-black-dragon, or None if there is none."""
    target = name.removeprefix(f"{TARGET_RECIPE}-")
    return target if target != name and target in list_targets() else None


def scenario_source(name_or_path: str | Path) -> bytes:
    """Read a scenario's file, built-in or a user's.

    Returns
    -------
    bytes
        Contents as in the file, not checked.

    Raises
    ------
    UserError
        If it is missing or cannot be read.
    """
    return _source("scenario", name_or_path)


def built_in_text(kind: Kind, name: str) -> str:
    """Return the file of a built-in scenario or recipe, or of a recipe that another package adds.

    Raises
    ------
    UserError
        If there is none.
    """
    if name not in _names(kind):
        raise UserError(_unknown_name_message(kind, name))
    built_in = files("flyaround.assets").joinpath(f"{kind}s", f"{name}.toml")
    if built_in.is_file():
        return built_in.read_text(encoding="utf-8")
    plugin = plugins("recipe")[name]
    file = plugin.load()
    try:
        return str(file.read_text(encoding="utf-8"))
    except (AttributeError, OSError, ValueError) as error:
        raise plugin.wrong(f"cannot be read ({error})") from error


def toml_table(content: bytes, source: str) -> dict[str, Any]:
    """Parse a TOML file for msgspec, and add the layers of its environment's preset.

    Returns
    -------
    dict
        Values of the file by key, tables as dict. In ``environment`` the file's own keys take precedence over the
        preset's.

    Raises
    ------
    UserError
        If it is not TOML, or has a value of an unsupported type.
    """
    raw: dict[str, Any] = _toml_values(parse_toml(content, source), source, "")
    section = raw.get("environment")
    # validation reports an unknown preset
    if isinstance(section, dict) and section.get("preset") in ENVIRONMENTS:
        raw["environment"] = {**msgspec.structs.asdict(ENVIRONMENTS[section["preset"]]), **section}
    return raw


def parse_scenario(content: bytes, source: str, stem: str, folder: Path) -> Scenario:
    """Parse a scenario from a file's contents.

    Parameters
    ----------
    content : bytes
        TOML text.
    source : str
        Name of the file in messages.
    stem : str
        Default name of the scenario.
    folder : Path
        Folder of the files that it names.

    Returns
    -------
    Scenario
        Checked scenario.

    Raises
    ------
    UserError
        If it has a mistake: key, value and allowed values.
    """
    raw = toml_table(content, source)
    scenario = convert_document(raw, Scenario, source)
    try:
        Instant.from_utc(scenario.epoch_utc)
    except ValueError as error:
        raise UserError(f"{source}: key epoch_utc: {error}") from error
    scenario = _unify_masses(_resolve(scenario, source, stem, folder), raw, source)
    scenario = resolve_messages(scenario, source, folder)
    check_document(scenario, source)
    if scenario.faults is not None:
        check_times(scenario.faults, source)
    return scenario


def _resolve(document: _Document, source: str, stem: str, folder: Path) -> _Document:
    """Return the document with its name set, and with its camera and PSF files read and checked."""
    camera = document.camera
    if not isinstance(camera, CameraFile):
        try:
            camera_file = read_camera_file(camera, folder)
        except UserError as error:
            raise UserError(f"{source}: key camera: {error}") from error
        camera = msgspec.structs.replace(camera_file, name=camera_file.name or Path(camera).stem)
    camera.camera(f"{source}: camera")
    document = msgspec.structs.replace(
        document,
        name=document.name or stem,
        camera=camera,
        optics=document.optics.with_kernel(folder, source),
    )
    document.camera_model  # noqa: B018 - raises if the region or the binning does not fit
    _check_detector(document, source)
    return document


def _check_detector(document: Scenario | Recipe, source: str) -> None:
    """Raise if a lens or detector is impossible, or does not match the bands."""
    sensor, optics, bands = document.sensor_model, document.optics.optics(), document.output.bands
    problem = (
        sensor_problem(sensor)
        or optics_problem(optics)
        or focus_problem(optics, document.camera_model, sensor)
        or response_problem(sensor, optics, 1 if bands == "mono" else 3)
    )
    detector = sensor.detector
    if problem is None and detector is not None and detector.colour_filter != "none" and bands == "mono":
        problem = (
            f'sensor.detector.colour_filter is {detector.colour_filter!r}, which needs output.bands = "rgb"'
        )
    if problem is not None:
        raise UserError(f"{source}: key {problem}")


def _unify_masses(scenario: Scenario, raw: dict[str, Any], source: str) -> Scenario:
    """Copy the chaser's mass from `[forces]` to its thrusters, unless they specify one.

    Raises
    ------
    UserError
        If the two masses differ.
    """
    thrusters, mass_kg = scenario.chaser.acting_thrusters, scenario.forces.chaser.mass_kg
    if thrusters is None or mass_kg is None or thrusters.mass_kg == mass_kg:
        return scenario
    if "mass_kg" in raw["chaser"].get("thrusters", {}):
        raise UserError(
            f"{source}: key chaser.thrusters.mass_kg is {thrusters.mass_kg:g} and forces.chaser.mass_kg {mass_kg:g}, "
            "allowed: one mass of the chaser: remove one of them"
        )
    updated = msgspec.structs.replace(thrusters, mass_kg=mass_kg)
    chaser = msgspec.structs.replace(scenario.chaser, thrusters=updated)
    return msgspec.structs.replace(scenario, chaser=chaser)


def _with_base(raw: dict[str, Any], source: str, folder: Path) -> dict[str, Any]:
    """Merge the sections of a recipe into those of its bases; ``[vary]`` is merged by key.

    Raises
    ------
    UserError
        If a base is missing, or the bases form a cycle.
    """
    merged = raw
    for base in _bases(raw, source, folder):
        merged_vary = _merge({"vary": base.get("vary")}, {"vary": merged["vary"]}) if "vary" in merged else {}
        merged = {**{k: v for k, v in base.items() if k not in _NOT_INHERITED}, **merged, **merged_vary}
    return merged


def _merge(base: dict[str, Any], override: dict[str, Any]) -> dict[str, Any]:
    """Merge two nested tables by key; a value of ``override`` replaces that of ``base``."""
    return base | {
        key: _merge(base[key], value)
        if isinstance(value, dict) and isinstance(base.get(key), dict)
        else value
        for key, value in override.items()
    }


def _bases(raw: dict[str, Any], source: str, folder: Path) -> Iterator[dict[str, Any]]:
    for _ in range(MAX_BASES):
        name = raw.get("base", "")
        if not name:
            return
        if not isinstance(name, str):
            raise UserError(f"{source}: key base is {name!r}, allowed: the name of a recipe in quotes")
        names = list_recipes()
        if name in names:
            content = built_in_text("recipe", name).encode()
        else:
            path = find_beside(folder / Path(source).name, name, "base")
            advice = f"name one of {', '.join(names)}, or a file beside this one"
            content = read_toml(path, f"{source}: key base: {path}", advice)
        source = f"{source}: base {name}"
        raw = toml_table(content, source)
        yield raw
    raise UserError(
        f"{source}: key base: the recipe has more than {MAX_BASES} bases, or they form a cycle; remove one"
    )


def _resolve_pose_file(poses: AnyPoses | None, source: str, folder: Path) -> AnyPoses | None:
    """Return the poses with a path relative to the recipe's folder resolved."""
    if poses is None:
        return None
    key = "file" if isinstance(poses, PoseList) else "scenario"
    name = getattr(poses, key)
    if not name.strip():
        raise UserError(f"{source}: section [poses] gives neither a file nor a scenario; give one")
    return msgspec.structs.replace(poses, **{key: str(folder / name)}) if (folder / name).is_file() else poses


def _toml_values(value: Any, source: str, key: str) -> Any:  # noqa: ANN401 - a TOML value is anything
    """Convert TOML values for msgspec: a time becomes text in UTC."""
    if isinstance(value, dict):
        return {k: _toml_values(v, source, f"{key}.{k}" if key else k) for k, v in value.items()}
    if isinstance(value, list):
        return [_toml_values(v, source, f"{key}[{i}]") for i, v in enumerate(value)]
    if isinstance(value, dt.datetime):
        if value.tzinfo is None:
            raise UserError(
                f"{source}: key {key} is {value.isoformat()}, which names no time zone: end it with Z"
            )
        utc = value.astimezone(dt.UTC).replace(tzinfo=None)
        return utc.isoformat() + "Z"
    return value


def _built_in_names(kind: Kind) -> tuple[str, ...]:
    folder = files("flyaround.assets").joinpath(f"{kind}s")
    return tuple(sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")))


def _names(kind: Kind) -> tuple[str, ...]:
    return list_scenarios() if kind == "scenario" else list_recipes()


def _origin(kind: Kind, name_or_path: str | Path) -> tuple[str, str, Path]:
    """Return the name for messages, the default document name, and the folder of relative paths."""
    text, path = str(name_or_path), Path(name_or_path)
    if text in _names(kind):
        return f"built-in {kind} {text}", text, Path()
    return text, path.stem, path.parent


def _source(kind: Kind, name_or_path: str | Path) -> bytes:
    """Return the contents of a file: built-in, a package's or a user's."""
    text, path = str(name_or_path), Path(name_or_path)
    if text in _names(kind):
        return built_in_text(kind, text).encode()
    try:
        if not path.is_file():
            raise UserError(_unknown_name_message(kind, text))
        return read_regular(path, MAX_TOML_BYTES)
    except OSError as error:
        raise UserError(f"{text} cannot be read: {error.strerror or error}; check the path") from error


def _unknown_name_message(kind: Kind, text: str) -> str:
    names = _names(kind)
    if text.endswith(".toml") or re.search(r"[/\\]", text):
        return f"there is no {kind} file {text!r}: give a TOML file, or one of {', '.join(names)}"
    near = near_names(text, names, 3)
    hint = f"did you mean {' or '.join(near)}?" if near else f"built-in ones are {', '.join(names)}"
    more = f", or {TARGET_RECIPE}-NAME of a target" if kind == "recipe" else ""
    return f"there is no {kind} {text!r}: {hint}{more}"
