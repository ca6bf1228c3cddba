"""Small images of every recipe, each tested by `check` and by ray casting the exported mesh; a table of the results."""

from __future__ import annotations

import argparse
import json
import time
from collections import defaultdict
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.dataset.capture import capture_card
from flyaround.simulator.dataset.check.verify import check_frame
from flyaround.simulator.labels.request import LabelRequest
from flyaround.simulator.loop import FrameRequest, open_frames, whole_frame
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.scenario.load import list_recipes, load_recipe
from tools.validation.datasets.ray_cast import ExportedMesh, compare

if TYPE_CHECKING:
    from collections.abc import Iterator

    from flyaround.simulator.recipes.plan import RecipePlan
    from flyaround.simulator.targets.model import Target

# label layers; poses of several craft are tested by name
_LABELS = ("parts", "amodal", "clean")


def recipes() -> list[str]:
    """Return the names of the built-in recipes that are one data set."""
    return [name for name in list_recipes() if not load_recipe(name).members]


def small_plan(name: str, n: int, seed: int, width_px: int, camera: str | None = None) -> RecipePlan:
    """Return a recipe's plan, optionally with another camera, at fewer pixels and the same field of view."""
    plan = plan_recipe(name, n, seed=seed, camera=camera)
    return replace(plan, camera=plan.camera.resized(min(width_px, plan.camera.width_px)))


def prove(
    name: str, n: int, seed: int, width_px: int, first: int = 0, camera: str | None = None
) -> Iterator[dict[str, Any]]:
    """Yield the findings for each image of a recipe from number ``first``, with its own camera or another."""
    plan = small_plan(name, n, seed, width_px, camera)
    card = capture_card(plan, ("native",), _LABELS, None, ())
    with open_frames(whole_frame, first=plan.scene(first), target=plan.target) as producer:
        for k in range(first, n):
            producer.submit(FrameRequest(scene=plan.scene(k), labels=LabelRequest(layers=_LABELS)))
            frame = producer.result()
            if frame.truth is None or frame.mask is None:
                raise RuntimeError("a labelled frame has truth and mask")
            target = frame.scene.target.drawn(plan.target)
            mask = np.asarray(frame.mask, np.uint8)
            faults = check_frame(k, frame.truth, frame.image, mask, card, target, frame.layers)
            rays = compare(frame.truth, mask, frame.layers["parts"], _exported(target))
            yield {
                "recipe": name,
                "k": k,
                "seed": seed,
                "camera": camera,
                "faults": faults,
                **asdict(rays),
            }


@lru_cache(maxsize=2)
def _exported(target: Target) -> ExportedMesh:
    return ExportedMesh(target)


def main() -> int:
    """Test as many images as requested; return 1 if a label is wrong."""
    parser = argparse.ArgumentParser(prog="python -m tools.validation.datasets", description=__doc__)
    parser.add_argument("-n", type=int, default=400, help="images of each recipe")
    parser.add_argument("--recipe", action="append", help="only this recipe (repeatable)")
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--camera", help="name or file of a camera to use instead of each recipe's own")
    parser.add_argument("--width", type=int, default=384, help="width of the images")
    parser.add_argument(
        "--at-once", type=int, default=25, help="images of a recipe before the next recipe continues"
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("out/datasets/found.jsonl"))
    options = parser.parse_args()
    options.output.parent.mkdir(parents=True, exist_ok=True)
    names = options.recipe or recipes()
    done = _done(options.output, options.seed, options.camera)
    for end in range(options.at_once, options.n + options.at_once, options.at_once):
        for name in names:
            last = min(end, options.n)
            if done[name] >= last:
                continue
            start_s = time.process_time()
            with options.output.open("a") as file:
                for row in prove(name, last, options.seed, options.width, done[name], options.camera):
                    file.write(json.dumps(row) + "\n")
                    file.flush()
            each_s = (time.process_time() - start_s) / (last - done[name])
            done[name] = last
            print(f"{name}: {last} images, {each_s:.2f} processor s each", flush=True)
    return tell(options.output)


def _done(path: Path, seed: int, camera: str | None) -> dict[str, int]:
    """Return the number of images of each recipe that were tested before."""
    done: dict[str, int] = defaultdict(int)
    for row in _rows(path):
        if (row["seed"], row.get("camera")) == (seed, camera):
            done[row["recipe"]] = max(done[row["recipe"]], row["k"] + 1)
    return done


def _rows(path: Path) -> list[dict[str, Any]]:
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text().splitlines() if line.endswith("}")]


def tell(path: Path) -> int:
    """Print a table of all results; return 1 if a label is wrong."""
    rows = _rows(path)
    total: dict[str, list[int]] = defaultdict(lambda: [0] * 6)
    for row in rows:
        for name in (row["recipe"], "all"):
            for i, x in enumerate(
                (1, row["n_rays"], bool(row["faults"]), row["mask"], row["parts"], row["twice"])
            ):
                total[name][i] += x
    print(
        "| recipe | images | rays | images that check refuses | mask px | part px | px in two masks or none |"
    )
    print("|---|---|---|---|---|---|---|")
    for name in [*sorted(n for n in total if n != "all"), "all"]:
        print(f"| {name} | " + " | ".join(f"{x:,}" for x in total[name]) + " |")
    bad = [row for row in rows if row["faults"] or row["mask"] or row["parts"] or row["twice"]]
    for row in bad[:20]:
        print(row)
    return 1 if bad else 0
