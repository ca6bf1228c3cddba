"""Test of every label of random frames over all targets, cameras and lighting.

    python -m tools.validation.labels -n 1000 --seed 1 --results results.jsonl

Frame k is a function of (seed, k). Two processes render and check; the results file grows by a line per frame, and an
interrupted run continues. Every tenth frame is checked from its files, the others in memory. In every fifth frame one
label is corrupted if the craft is large enough, and the check must detect it. After a correction, ``--again`` repeats
frames with errors; the page names the commits of the results.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import queue
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from flyaround.simulator.dataset.card import CardMachine, CardTarget, DatasetCard, describe_machine
from flyaround.simulator.dataset.check.verify import check_frame
from flyaround.simulator.dataset.formats.native import frame_paths, read_layer, read_png, write_frame
from flyaround.simulator.frame import Frame, take_frame
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.files import write_atomic
from tools.validation.labels.faults import FAULTS, inject_fault
from tools.validation.labels.frames import cached_target, random_frame

if TYPE_CHECKING:
    from collections.abc import Iterator

PAGE = Path("docs/validation/labels.md")
RESULTS = Path("out/label_results.jsonl")
FROM_FILES_EVERY = 10  # every tenth frame is also checked from files
SPOILT_EVERY = 5  # every fifth frame is also checked with injected faults


def check_one(renderer: Renderer, seed: int, k: int) -> dict[str, Any]:
    """Render frame k, check it, and return the result."""
    scene, request = random_frame(seed, k)
    target = cached_target(scene.target.name)
    start = time.process_time()
    frame = take_frame(renderer, scene, target, labels=request)
    drawn = time.process_time()
    card = dataset_card(renderer, frame, seed)
    if k % FROM_FILES_EVERY == 0:
        with tempfile.TemporaryDirectory() as folder:
            frame = _through_files(Path(folder), frame)
    faults = _check(k, frame, card)
    result: dict[str, Any] = {
        "k": k,
        "target": scene.target.name,
        "lens": scene.camera.distortion.model,
        "shutter": scene.shutter.kind,
        "labels": 0 if frame.truth is None else len(frame.truth.keypoints) + len(frame.truth.layers) + 7,
        "pixels": 0 if frame.mask is None else int(np.count_nonzero(frame.mask)),
        "draw_ms": round(1e3 * (drawn - start), 1),
        "check_ms": round(1e3 * (time.process_time() - drawn), 1),
        "faults": faults,
    }
    if k % SPOILT_EVERY == 0 and not faults:
        kinds, first = list(FAULTS), k // SPOILT_EVERY % len(FAULTS)
        for kind in kinds[first:] + kinds[:first]:
            spoilt = inject_fault(kind, frame)
            if spoilt is not None:
                result |= {"spoilt": kind, "caught": bool(_check(k, spoilt, card))}
                break
    return result


def _check(k: int, frame: Frame, card: DatasetCard) -> list[str]:
    if frame.truth is None or frame.mask is None:
        raise RuntimeError("the frame was rendered without labels")
    target = cached_target(frame.scene.target.name)
    return check_frame(k, frame.truth, frame.image, frame.mask, card, target, frame.layers)


def _through_files(folder: Path, frame: Frame) -> Frame:
    """Return the frame as written to and read from disk."""
    (folder / "images").mkdir()
    k = frame.scene.frame_index
    write_frame(folder, k, frame)
    paths = frame_paths(folder, k)
    truth = read_truth(paths.truth)
    layers = {name: read_layer(folder / "images", f"{k:06d}", name) for name in truth.layer_sha256}
    return Frame(
        truth.scene,
        read_png(paths.image),
        frame.radiance,
        truth,
        np.asarray(read_png(paths.mask), np.uint8),
        None,
        layers,
    )


def dataset_card(renderer: Renderer, frame: Frame, seed: int) -> DatasetCard:
    """Return the card of a data set of such frames."""
    target, info = cached_target(frame.scene.target.name), renderer.info
    return DatasetCard(
        scenario_name="random frames",
        scenario={},
        seed=seed,
        n_frames=frame.scene.frame_index + 1,
        every_s=None,
        complete=True,
        formats=("native",),
        camera=frame.scene.camera,
        target=CardTarget.from_target(target),
        machine=_machine(info.vendor, info.renderer, info.version),
    )


@cache
def _machine(vendor: str, renderer: str, version: str) -> CardMachine:
    return describe_machine(vendor, renderer, version)


def _work(seed: int, numbers: list[int], results: multiprocessing.Queue[dict[str, Any]]) -> None:
    with Renderer() as renderer:
        for k in numbers:
            try:
                results.put(check_one(renderer, seed, k))
            except Exception as error:  # noqa: BLE001 - a frame that fails is a result, and the others continue
                results.put({"k": k, "faults": [f"{type(error).__name__}: {error}"]})


def run(seed: int, numbers: list[int], workers: int) -> Iterator[dict[str, Any]]:
    """Yield results in order of arrival.

    Raises
    ------
    RuntimeError
        If a process died before its frames were checked.
    """
    # images this small render fastest without threads
    os.environ.setdefault("LP_NUM_THREADS", "0")
    context = multiprocessing.get_context("spawn")
    results: multiprocessing.Queue[dict[str, Any]] = context.Queue()
    processes = [
        context.Process(target=_work, args=(seed, numbers[w::workers], results), daemon=True)
        for w in range(workers)
    ]
    for process in processes:
        process.start()
    remaining = len(numbers)
    while remaining:
        try:
            yield results.get(timeout=10)
            remaining -= 1
        except queue.Empty:
            if any(process.exitcode for process in processes):
                raise RuntimeError(f"a rendering process died with {remaining} frames left") from None
    for process in processes:
        process.join()


def _commit() -> str:
    """Return the commit of this checkout, followed by + if files were changed."""
    try:
        run_git = partial(
            subprocess.run, cwd=Path(__file__).parent, capture_output=True, text=True, check=True
        )
        head = run_git(["git", "rev-parse", "--short=7", "HEAD"]).stdout.strip()
        changed = run_git(["git", "status", "--porcelain", "--untracked-files=no"]).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return head + ("+" if changed else "")


def newest(lines: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the last result of each frame, with ``mended`` if an earlier one was wrong."""
    by_frame: dict[int, dict[str, Any]] = {}
    for line in lines:
        before = by_frame.get(line["k"])
        mended = before is not None and (bool(before["faults"]) or before.get("mended", False))
        by_frame[line["k"]] = line | ({"mended": True} if mended else {})
    return list(by_frame.values())


def summary(lines: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the summary of all results."""
    wrong = [line for line in lines if line["faults"]]
    spoilt = [line for line in lines if "spoilt" in line]
    drawn = [line for line in lines if "draw_ms" in line]
    return {
        "frames": len(lines),
        "labels": sum(line.get("labels", 0) for line in lines),
        "wrong_frames": len(wrong),
        "spoilt": len(spoilt),
        "spoilt_and_missed": Counter(line["spoilt"] for line in spoilt if not line["caught"]),
        "draw_ms": float(np.median([line["draw_ms"] for line in drawn])) if drawn else None,
        "check_ms": float(np.median([line["check_ms"] for line in drawn])) if drawn else None,
        "targets": Counter(line["target"] for line in drawn),
        "lenses": Counter(line["lens"] for line in drawn),
        "shutters": Counter(line["shutter"] for line in drawn),
        "commits": Counter(line.get("commit", "unknown") for line in lines),
        "mended": sorted(line["k"] for line in lines if line.get("mended") and not line["faults"]),
        "first_faults": [{"k": line["k"], "faults": line["faults"]} for line in wrong[:20]],
    }


def page(results: dict[str, Any], seed: int) -> str:
    """Return the page with the summary."""
    command = f"python -m tools.validation.labels -n {results['frames']} --seed {seed} --page"
    spoilt, missed = results["spoilt"], sum(results["spoilt_and_missed"].values())
    lines = [
        "# Labels of random frames",
        "",
        f"Made by `{command}`: frames of every target, lens, detector,",
        "light and motion, of 48 to 160 pixels, most at a target's lowest level of detail.",
        "",
        "| | |",
        "|---|---|",
        f"| frames | {results['frames']} |",
        f"| labels | {results['labels']} |",
        f"| frames with a wrong label | {results['wrong_frames']} |",
        f"| labels spoilt on purpose, and missed | {spoilt}, {missed} |",
        f"| frames wrong at first, right after a mend | {', '.join(map(str, results['mended'])) or 'none'} |",
        f"| frames by commit | {_counts(results['commits'])} |",
        f"| processor time of a frame (median) | {results['draw_ms']:.0f} ms |",
        f"| processor time of its check (median) | {results['check_ms']:.0f} ms |",
        f"| lenses | {_counts(results['lenses'])} |",
        f"| shutters | {_counts(results['shutters'])} |",
        f"| targets | {_counts(results['targets'])} |",
    ]
    lines += [f"| frame {w['k']} | {'; '.join(w['faults'])} |" for w in results["first_faults"]]
    return "\n".join(lines) + "\n"


def _counts(counter: dict[str, int]) -> str:
    return ", ".join(f"{name} {n}" for name, n in sorted(counter.items()))


def main() -> int:
    """Run the test and return the exit code: 1 if a label is wrong or a corrupted one is not detected."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-n", type=int, default=200, help="frames")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument(
        "--results", type=Path, default=RESULTS, help=f"one line per frame (default: {RESULTS})"
    )
    parser.add_argument("--page", action="store_true", help=f"write {PAGE} from the existing results")
    parser.add_argument("--again", action="store_true", help="repeat frames with wrong labels")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # end the worker processes with this one
    lines: list[dict[str, Any]] = []
    if options.results.is_file():
        lines = [json.loads(line) for line in options.results.read_text().splitlines()]
    known = {line["k"] for line in newest(lines) if not (options.again and line["faults"])}
    numbers = [k for k in range(options.n) if k not in known]
    commit = _commit()
    options.results.parent.mkdir(parents=True, exist_ok=True)
    with options.results.open("a") as file:
        for found_now in run(options.seed, numbers, min(max(1, options.workers), len(numbers))):
            result = found_now | {"commit": commit}
            lines.append(result)
            file.write(json.dumps(result) + "\n")
            file.flush()
            if result["faults"]:
                print(f"frame {result['k']}: {'; '.join(result['faults'])}", flush=True)
    totals = summary([line for line in newest(lines) if line["k"] < options.n])
    if options.page:
        write_atomic(PAGE, page(totals, options.seed).encode())
    print(msgspec.json.format(msgspec.json.encode(totals), indent=1).decode())
    return 1 if totals["wrong_frames"] or totals["spoilt_and_missed"] else 0
