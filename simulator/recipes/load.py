"""Reading recipes: built-in names and TOML files, every mistake in one sentence."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from flyaround.simulator.errors import UserError, near_names
from flyaround.simulator.recipes.checks import check_recipe
from flyaround.simulator.recipes.file import Recipe
from flyaround.simulator.recipes.vary_file import check_vary
from flyaround.simulator.runtime.plugins import plugins
from flyaround.simulator.runtime.toml_file import MOST_TOML_BYTES
from flyaround.simulator.runtime.untrusted_files import find_beside, read_regular
from flyaround.simulator.runtime.validation_errors import explain
from flyaround.simulator.scenario.load import check_detector, resolve_camera, toml_table
from flyaround.simulator.scenario.show import annotated_text
from flyaround.simulator.targets.library import list_targets

if TYPE_CHECKING:
    from collections.abc import Iterator

MOST_BASES = 8
_OF_TARGET = "eval-black-"
"""Names of the recipe eval-black with a target: eval-black-dragon is eval-black with --target dragon."""
_NOT_INHERITED = ("base", "name", "members")


def list_recipes() -> tuple[str, ...]:
    """Names of the built-in recipes, then of those that other packages add."""
    folder = files("flyaround.assets").joinpath("recipes")
    built_in = sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))
    return (*built_in, *(name for name in plugins("recipe") if name not in built_in))


def is_recipe(name_or_path: str) -> bool:
    """Whether a name is a built-in recipe's, or that of a file which calls itself one."""
    if name_or_path in list_recipes() or _target_in(name_or_path) is not None:
        return True
    path = Path(name_or_path)
    try:
        return path.is_file() and b"flyaround.recipe" in read_regular(path, MOST_TOML_BYTES)
    except (OSError, UserError):
        return False


def recipe_text(name: str) -> str:
    """The file of a built-in recipe.

    Raises
    ------
    UserError
        If there is none of that name.
    """
    if name not in list_recipes():
        raise UserError(_no_such_recipe(name))
    built_in = files("flyaround.assets").joinpath("recipes", f"{name}.toml")
    if built_in.is_file():
        return built_in.read_text(encoding="utf-8")
    plugin = plugins("recipe")[name]
    file = plugin.load()
    try:
        return str(file.read_text(encoding="utf-8"))
    except (AttributeError, OSError, ValueError) as error:
        raise plugin.wrong(f"is no file that can be read ({error})") from error


def load_recipe(name_or_path: str | Path) -> Recipe:
    """A recipe by its built-in name or from a TOML file, with what it takes from its base.

    Raises
    ------
    UserError
        If there is none, or the file has a mistake: file, key, value given and what is allowed.
    """
    text = str(name_or_path)
    target = _target_in(text)
    if target is not None:
        recipe = load_recipe(_OF_TARGET.rstrip("-"))
        title = f"{recipe.title}, of {target}"
        return msgspec.structs.replace(recipe, name=text, title=title, target=target)
    if text in list_recipes():
        where, stem, folder = f"built-in recipe {text}", text, Path()
        content = recipe_text(text).encode()
    else:
        path = Path(name_or_path)
        where, stem, folder = text, path.stem, path.parent
        try:
            if not path.is_file():
                raise UserError(_no_such_recipe(text))
            content = read_regular(path, MOST_TOML_BYTES)
        except OSError as error:
            raise UserError(f"{text} cannot be read: {error.strerror or error}; check the path") from error
    raw = _with_base(toml_table(content, where), where, folder)
    try:
        recipe = msgspec.convert(raw, Recipe)
    except msgspec.ValidationError as error:
        raise UserError(f"{where}: {explain(str(error), raw, Recipe)}") from error
    camera = resolve_camera(recipe.camera, where, folder)
    recipe = msgspec.structs.replace(
        recipe,
        name=recipe.name or stem,
        camera=camera,
        optics=recipe.optics.with_kernel(folder, where),
        poses=_beside(recipe.poses, where, folder),
    )
    check_detector(recipe.sensor.model(camera, where), recipe.optics.optics(), recipe.output.bands, where)
    check_recipe(recipe, where)
    if recipe.vary is not None:
        check_vary(recipe.vary, where)
    return recipe


def show_recipe(name: str) -> str:
    """The file of a built-in recipe with every further key as a comment: its value unless given, and what is allowed.

    Raises
    ------
    UserError
        If there is none of that name.
    """
    target = _target_in(name)
    text = recipe_text(name if target is None else _OF_TARGET.rstrip("-"))
    if target is not None:
        text = text.replace('target = "tango"', f'target = "{target}"')
    head = [
        f"# Recipe {name}. Keep it as mine.toml, change it, and draw: flyaround capture mine.toml -n 20 -o mine",
        "# A key behind a # has the value shown unless it is given, here or in the base; ... is for one that has none.",
        "# Keys are explained in docs/datasets.md; units are in their names.",
    ]
    return annotated_text(text, Recipe, head)


def recipe_json_schema() -> dict[str, Any]:
    """JSON Schema of the recipe file."""
    return msgspec.json.schema(Recipe)


def _target_in(name: str) -> str | None:
    """The target that a name such as eval-black-dragon says, None of another name."""
    target = name.removeprefix(_OF_TARGET)
    return target if target != name and target in list_targets() else None


def _with_base(raw: dict[str, Any], where: str, folder: Path) -> dict[str, Any]:
    """The file's sections over those of its bases.

    Raises
    ------
    UserError
        If a base is missing, or they go round in a circle.
    """
    merged = raw
    for base in _bases(raw, where, folder):
        merged = {**{k: v for k, v in base.items() if k not in _NOT_INHERITED}, **merged}
    return merged


def _bases(raw: dict[str, Any], where: str, folder: Path) -> Iterator[dict[str, Any]]:
    for _ in range(MOST_BASES):
        name = raw.get("base", "")
        if not name:
            return
        if not isinstance(name, str):
            raise UserError(f"{where}: key base is {name!r}, allowed: the name of a recipe in quotes")
        if name in list_recipes():
            content = recipe_text(name).encode()
        else:
            path = find_beside(folder / Path(where).name, name, "base")
            try:
                content = read_regular(path, MOST_TOML_BYTES)
            except OSError as error:
                raise UserError(
                    f"{where}: key base: {path} cannot be read: {error.strerror or error}; name one of "
                    f"{', '.join(list_recipes())}, or a file beside this one"
                ) from error
        where = f"{where}: base {name}"
        raw = toml_table(content, where)
        yield raw
    raise UserError(
        f"{where}: key base: recipes stand on each other {MOST_BASES} deep or in a circle; cut one"
    )


def _beside(poses: Any, where: str, folder: Path) -> Any:  # noqa: ANN401 - each kind of poses in and out
    """Poses whose files are paths from here."""
    if poses is None:
        return None
    name = poses.file if hasattr(poses, "file") else poses.scenario
    if not name.strip():
        raise UserError(f"{where}: section [poses] names no file or scenario; give one")
    if (folder / name).is_file():
        key = "file" if hasattr(poses, "file") else "scenario"
        return msgspec.structs.replace(poses, **{key: str(folder / name)})
    return poses


def _no_such_recipe(text: str) -> str:
    names = list_recipes()
    if text.endswith(".toml") or "/" in text or "\\" in text:
        return f"there is no recipe file {text!r}: give a TOML file, or one of {', '.join(names)}"
    near = near_names(text, names, 3)
    hint = f"did you mean {' or '.join(near)}?" if near else f"built-in ones are {', '.join(names)}"
    return f"there is no recipe {text!r}: {hint}, or eval-black-NAME of a target"
