"""Every caution and warning in the sources has a way to end with its cause, and those of a flight do end."""

from __future__ import annotations

import ast
import importlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from flyaround.gui.console import Console
from flyaround.simulator.piloting.cautions import ENDS
from tests.harness.flown_console import console_flying

ROOT = Path(__file__).parents[2]
LEVELS = {"caution", "warning"}


def parsed(*folders: str) -> Iterator[tuple[str, ast.AST]]:
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*.py")):
            module = f"flyaround.{'.'.join(path.relative_to(ROOT).with_suffix('').parts)}"
            for node in ast.walk(ast.parse(path.read_text())):
                yield module, node


def levels(node: ast.AST) -> set[object]:
    return {n.value for n in ast.walk(node) if isinstance(n, ast.Constant)} & LEVELS


def words(module: str, node: ast.AST) -> str:
    """Constants of an expression, and those of the module that it names."""
    values = vars(importlib.import_module(module))
    found = []
    for n in ast.walk(node):
        if isinstance(n, ast.Constant):
            found.append(str(n.value))
        elif isinstance(n, ast.Name):
            found.append(str(values.get(n.id, "")))
    return " ".join(found)


def test_every_caution_of_a_flight_has_an_end() -> None:
    cautions = [
        (module, node)
        for module, node in parsed("simulator/piloting")
        if isinstance(node, ast.Tuple)
        and len(node.elts) == 2
        and getattr(node.elts[0], "value", "") in LEVELS
    ]
    # those of a piloted flight; a new one needs its line in ENDS
    assert len(cautions) >= 11
    ended = set()
    for module, node in cautions:
        text = words(module, node.elts[1])
        text += " stops the chaser" * ("closed" in ast.unparse(node))
        found = {phrase for phrase in ENDS if phrase in text}
        assert found, f"{module}, line {node.lineno}: {ast.unparse(node)}"
        ended |= found
    assert ended == set(ENDS)


def test_every_caution_of_the_console_names_its_command_or_its_end() -> None:
    for module, node in parsed("gui"):
        is_say = isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "say"
        if is_say and len(node.args) > 1 and levels(node.args[1]):
            named = len(node.args) > 2 or any(k.arg in {"of", "over"} for k in node.keywords)
            assert named, f"{module}, line {node.lineno}: {ast.unparse(node)}"


# --- flown


@pytest.fixture
def console() -> Iterator[Console]:
    made = console_flying("tango-space-10m")
    made.pass_time(20)
    yield made
    made.close()


def waiting(console: Console) -> list[str]:
    console.pass_time(100)
    # thrusts of guidance strike the target, too
    return [m.text for m in console.messages.waiting if not m.text.startswith("the plume")]


def test_station_keeping_ends_the_drift(console: Console) -> None:
    craft = console.session.craft
    console.do("guidance.drift")
    waiting(console)
    chaser = craft.steered
    assert chaser is not None
    outward = tuple(5 * x for x in chaser.position_eci_m)
    craft.steered = replace(chaser, position_eci_m=outward, velocity_eci_m_s=tuple(x / 100 for x in outward))
    assert ["drifts away" in text for text in waiting(console)] == [True]
    console.do("guidance.hold")
    assert waiting(console) == []


def test_the_end_of_a_retreat_ends_its_warning(console: Console) -> None:
    console.do("docking.abort")
    assert len(waiting(console)) == 1
    console.do("guidance.hold")
    assert waiting(console) == []


def test_sunlight_and_a_released_guard_end_theirs() -> None:
    console = console_flying("tango-eclipse-pass")
    console.do("time.next-eclipse")
    while console.session.clock.jump:
        console.pass_time(100)
    console.do("time.rate", "10")
    while not console.messages.waiting:
        console.pass_time(100)
    assert "eclipse" in console.messages.waiting[0].text
    console.do("time.next-sunrise")
    while console.session.clock.jump:
        console.pass_time(100)
    assert waiting(console) == []


def test_looking_back_ends_what_has_not_happened_yet(console: Console) -> None:
    console.do("guidance.drift")
    for _ in range(5):
        console.pass_time(200)
    console.do("docking.abort")
    spent = console.session.craft.steering.propellant
    console.session.craft.steering.propellant = replace(spent, used_kg=0.05 * spent.thrusters.mass_kg)
    assert {text.split(":")[0] for text in waiting(console)} == {"abort", "fuel is low"}
    console.do("timeline.seek", 0.2)
    assert waiting(console) == []


def test_a_refusal_ends_with_the_next_command_of_flying(console: Console) -> None:
    console.do("guidance.waypoint", 0, 0, 0)
    console.do("log.save", "/dev/null/x")
    assert len(waiting(console)) == 2
    console.do("guidance.hold")
    (kept,) = waiting(console)
    assert "/dev/null" in kept
