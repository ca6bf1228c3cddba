"""``capture`` of each recipe with six export formats and two processes, then ``check`` and reading back; a table."""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import msgspec

from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.scenario.load import list_recipes, load_recipe
from tools.validation.captures.read_back import FORMATS, read_back

_REFUSED = re.compile(r"format (\w+) cannot hold this data set: (.*)", re.DOTALL)


def flyaround(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command of Flyaround."""
    environment = os.environ | {"HF_HUB_OFFLINE": "1", "COLUMNS": "10000"}
    return subprocess.run(
        [sys.executable, "-m", "flyaround", *arguments],
        check=False,
        capture_output=True,
        text=True,
        env=environment,
    )


def prove(recipe: str, n: int, workers: int, width_px: int | None, out: Path) -> dict[str, Any]:
    """Capture a recipe, check it and read it back; return the findings."""
    folder, formats, refused = out / recipe, list(FORMATS), {}
    small = [] if width_px is None else _small_camera(recipe, width_px, out)
    while True:
        shutil.rmtree(folder, ignore_errors=True)
        start_s, used_s = time.perf_counter(), _processor_s()
        command = ["capture", recipe, "-n", str(n), "--format", ",".join(formats), "--workers", str(workers)]
        done = flyaround(*command, *small, "-o", str(folder), "--json")
        wall_s, processor_s = time.perf_counter() - start_s, _processor_s() - used_s
        lacks = _REFUSED.search(" ".join(done.stderr.split()))
        if done.returncode != 2 or lacks is None:
            break
        # reported before rendering starts; no file remains
        refused[lacks[1]] = lacks[2]
        formats.remove(lacks[1])
    result: dict[str, Any] = {"recipe": recipe, "n": n, "refused": refused, "capture_rc": done.returncode}
    if not done.stdout.strip():
        return result | {"error": done.stderr.strip()[-500:]}
    summary = json.loads(done.stdout)
    sets = summary.get("members", {"": summary})
    result["quarantined"] = [fault for one in sets.values() for fault in one["quarantined"]]
    result["images"] = sum(one["written"] for one in sets.values())
    result["burnt_out"] = max((one["clipping"] or {"share": 0.0})["share"] for one in sets.values())
    result["images_per_s"] = round(result["images"] / wall_s, 2)
    result["processor_s_each"] = round(processor_s / max(result["images"], 1), 3)
    result["faults"], result["read_back"] = [], []
    for member in sets:
        member_folder = folder / member
        checked = flyaround("check", str(member_folder), "--json")
        report = json.loads(checked.stdout) if checked.stdout.strip() else {"faults": [checked.stderr[-500:]]}
        result["faults"] += report["faults"]
        result["read_back"] += [what for name in formats for what in read_back(member_folder, name)]
    shutil.rmtree(folder, ignore_errors=True)
    return result


def _small_camera(recipe: str, width_px: int, out: Path) -> list[str]:
    """Return options for fewer pixels at the same field of view; empty for recipes of several data sets."""
    if load_recipe(recipe).members:
        return []
    camera = plan_recipe(recipe, 1).camera
    path = out / f"{recipe}.json"
    path.write_bytes(msgspec.json.encode(camera.resized(min(width_px, camera.width_px))))
    return ["--camera", str(path)]


def _processor_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> int:
    """Test all recipes, or the named ones; return 1 if there is an error."""
    parser = argparse.ArgumentParser(prog="python -m tools.validation.captures", description=__doc__)
    parser.add_argument("-n", type=int, default=40, help="images of each recipe")
    parser.add_argument("--recipe", action="append", help="only this recipe (repeatable)")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--width", type=int, help="width of the images (default: the recipe's)")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/captures"))
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    log = options.output / "found.jsonl"
    done = {json.loads(line)["recipe"] for line in log.read_text().splitlines()} if log.exists() else set()
    for recipe in options.recipe or list_recipes():
        if recipe in done:
            continue
        result = prove(recipe, options.n, options.workers, options.width, options.output)
        with log.open("a") as file:
            file.write(json.dumps(result) + "\n")
        print(_row(result), flush=True)
    return tell(log)


def _is_wrong(row: dict[str, Any]) -> bool:
    return bool(
        row["capture_rc"] or row.get("error") or row["quarantined"] or row["faults"] or row["read_back"]
    )


def _row(row: dict[str, Any]) -> str:
    if "error" in row:
        return f"| {row['recipe']} | {row['error']} | | | | | |"
    faults = len(row["faults"]) + len(row["quarantined"])
    return (
        f"| {row['recipe']} | {row['images']} | {faults} | {len(row['read_back'])} | "
        f"{100 * row['burnt_out']:.1f} | {row['images_per_s']:.2f} | {row['processor_s_each']:.2f} | "
        f"{'; '.join(f'{name}: {why}' for name, why in row['refused'].items())} |"
    )


def tell(log: Path) -> int:
    """Print a table of all results; return 1 if there is an error."""
    rows = [json.loads(line) for line in log.read_text().splitlines()]
    print(
        "| recipe | images | faults | read back wrong | burnt out [%] | images/s | processor s each | cannot hold it |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for row in sorted(rows, key=lambda r: str(r["recipe"])):
        print(_row(row))
    wrong = [row for row in rows if _is_wrong(row)]
    for row in wrong:
        print(json.dumps(row)[:2000])
    return 1 if wrong else 0
