"""Golden manifest: hashes of Flyaround's outputs, to compare two states of the code.

It hashes scenes in mono and RGB, with and without the shortcuts of the software path; labelled data sets, including a
stereo pair and an imported mesh; a replayed console script; poses of the estimator. All parts but the console script
run through the command line in this process: `python -m tools.fingerprint all -o before.json`, then in the other state
`python -m tools.fingerprint all --against before.json`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
import tempfile
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from unittest.mock import patch

import numpy as np

from flyaround.__main__ import run as run_command
from flyaround.gui.app import command_table, options_of
from flyaround.gui.console import Console
from flyaround.gui.picture.feed import Feed
from flyaround.gui.script import Script
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario
from tests.harness.no_renderer import NoRenderer

DATA = Path(__file__).parents[1] / "tests" / "data"
SQUARE = {'camera = "speed"': 'camera = "square-1024"'}
SCENES = {
    "earth-1920": ("tango-earth-10m", {}),
    "earth-1024": ("tango-earth-10m-1024", {}),
    "space": ("tango-space-10m", {}),
    "limb": ("tango-limb", {}),
    "night": ("tango-night", {}),
    "close": ("tango-close-3m", {}),
    "close-1024": ("tango-close-3m", SQUARE),
    "blur": ("tango-earth-10m-1024", {"exposure_s = 0.0009": "exposure_s = 0.02"}),
}
"""Built-in scenarios and the replacements in their text."""
BANDS: dict[str, tuple[str, ...]] = {"mono": (), "rgb": ("--rgb",)}
PATHS = {"plain": False, "software": True}
CAPTURES = {
    "tango-flyaround": ("tango-flyaround", "-n", "8", "--labels", "all"),
    "soyuz-earth": ("iss-orbit-limb", "-n", "6", "--seed", "71"),
    "eval-earth": ("eval-earth", "-n", "4", "--seed", "74", "--labels", "all"),
    "dragon-black": ("eval-black", "-n", "6", "--seed", "72", "--labels", "all", "--target", "dragon"),
    "inspection": ("inspection", "-n", "4", "--seed", "75", "--labels", "all"),
}
STEREO = "\n[second_camera]\nposition_m = [0.4, 0.0, 0.0]\nturn_deg = [0.0, -2.0, 0.0]\n"
MESHES = {
    "box": DATA / "v0.1" / "targets" / "box-v01.glb",
    "plate": DATA / "reports" / "obj_map_kd_options" / "o_opt_s.obj",
}
# recipe and number of images of each target
POSES = {"tango": ("eval-earth", 64), "soyuz-ms": ("eval-black", 32), "dragon": ("eval-black", 32)}
ANSWER = ("accepted", "reason", "q_camera_from_target_wxyz", "t_camera_from_target_m", "confidence")
NOT_HASHED = ("software", "machine", "run")
"""Sections of a card or record that describe how the file was made."""
STEP_MS = 40  # step of the console's clock


def run(*arguments: str | Path) -> str:
    """Return the standard output of a command that must succeed."""
    out, errors = StringIO(), StringIO()
    with redirect_stdout(out), redirect_stderr(errors):
        code = run_command([str(a) for a in arguments])
    if code:
        sys.exit(
            f"flyaround {' '.join(map(str, arguments))}: {code}\n{errors.getvalue()}{out.getvalue()[-2000:]}"
        )
    return out.getvalue()


def digest(content: bytes) -> str:
    """Return the first 80 bits of the SHA-256."""
    return hashlib.sha256(content).hexdigest()[:20]


def files_of(folder: Path, part: str) -> dict[str, str]:
    """Hash every file of a folder; JSON documents without the sections of `NOT_HASHED`."""
    hashes = {}
    for path in sorted(p for p in folder.rglob("*") if p.is_file() and ".lock" not in p.name):
        content = path.read_bytes()
        if path.suffix == ".json":
            content = json.dumps(_without_origin(json.loads(content))).encode()
        hashes[f"{part}/{path.relative_to(folder)}"] = digest(content)
    return hashes


def _without_origin(value: object) -> object:
    if isinstance(value, dict):
        return {key: _without_origin(v) for key, v in value.items() if key not in NOT_HASHED}
    return [_without_origin(v) for v in value] if isinstance(value, list) else value


def scenes(folder: Path) -> dict[str, str]:
    """Hash raw numbers, truth, mask and label layers of the scenes, in both bands and on both paths."""
    defaults = Renderer.__init__.__kwdefaults__
    for name, (scenario, changes) in SCENES.items():
        text = _changed(run("scenarios", "--show", scenario), changes)
        file = folder / f"{name}.toml"
        file.write_text(text, encoding="utf-8")
        for bands, options in BANDS.items():
            for path, software in PATHS.items():
                out = folder / "scenes" / name / f"{bands}-{path}"
                out.mkdir(parents=True)
                with patch.dict(defaults, software_path=software):
                    run("render", file, "-o", out / "frame.npy", "-t", "7.5", "--labels", "all", *options)
    return files_of(folder / "scenes", "scene")


def _changed(text: str, changes: dict[str, str]) -> str:
    for old, new in changes.items():
        if old not in text:
            sys.exit(f"the text has no line {old} to replace:\n{text}")
        text = text.replace(old, new, 1)
    return text


def frames(folder: Path) -> dict[str, str]:
    """Hash every file of small data sets, one of a stereo pair and one of an imported mesh among them."""
    stereo = folder / "stereo.toml"
    stereo.write_text(run("scenarios", "--show", "tango-flyaround") + STEREO, encoding="utf-8")
    captures = {**CAPTURES, "stereo": (str(stereo), "-n", "2", "--labels", "all")}
    with patch.dict(os.environ, FLYAROUND_DATA_DIR=str(folder / "data")):
        for name, mesh in MESHES.items():
            run("targets", "add", mesh, "--name", f"golden-{name}", "--no-sheet", "--yes")
            captures[name] = ("eval-black", "-n", "2", "--labels", "all", "--target", f"golden-{name}")
        for name, arguments in captures.items():
            run("capture", *arguments, "-o", folder / "frames" / name)
    for sheet in folder.rglob("contact_sheet.png"):
        sheet.unlink()
    return files_of(folder / "frames", "frame") | files_of(folder / "data", "mesh")


def console(_folder: Path) -> dict[str, str]:
    """Hash the flight of the console script recorded with version 0.1, step by step."""
    v01 = DATA / "v0.1"
    session, table = FlightSession.of(load_scenario(v01 / "session.toml")), command_table()
    replayed = Console(session, Feed(NoRenderer()), options_of(session), table)
    replayed.play(Script.read(v01 / "console.script", table))
    end_ms = round(1000 * json.loads((v01 / "console_end.json").read_text())["operator_s"])
    rows = []
    while replayed.clock_ms < end_ms:
        replayed.pass_time(min(STEP_MS, end_ms - replayed.clock_ms))
        world = session.craft.world
        state = (
            world.position_lvlh_m,
            world.velocity_lvlh_m_s,
            session.craft.steering.propellant.delta_v_m_s,
        )
        rows.append((session.t_s, *(str(np.asarray(x).tolist()) for x in state)))
    return {"console/v0.1": digest(json.dumps(rows).encode())}


def poses(kept: Path) -> dict[str, str]:
    """Hash the estimator's answers, without times, on 128 images that are rendered once and kept in a folder."""
    hashes = {}
    for target, (recipe, n) in POSES.items():
        data = kept / target
        if not (data / "dataset.json").exists():
            run("capture", recipe, "-o", data, "-n", str(n), "--seed", "73", "--target", target)
        images = sorted(p for p in (data / "images").glob("*.png") if ".mask" not in p.name)
        answers = json.loads(run("estimate", *images, "--target", target, "--camera", "speed", "--json"))
        for image, answer in zip(images, answers, strict=True):
            hashes[f"pose/{target}/{image.name}"] = digest(
                json.dumps({key: answer[key] for key in ANSWER}).encode()
            )
    return hashes


PARTS = {"scenes": scenes, "frames": frames, "console": console}


def main() -> int:
    """Compute the hashes; with ``--against`` list the differences, and return 1 if there are any."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("part", choices=(*PARTS, "poses", "all"))
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--against", type=Path)
    parser.add_argument(
        "--images", type=Path, default=Path("out/fingerprint"), help="folder of the 128 images"
    )
    choice = parser.parse_args()
    found: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, hashes in PARTS.items():
            if choice.part in (name, "all"):
                found |= hashes(Path(folder))
    if choice.part in ("poses", "all"):
        found |= poses(choice.images)
    if choice.output:
        choice.output.write_text(json.dumps(found, indent=1), encoding="utf-8")
    if not choice.against:
        print(f"{len(found)} hashes")
        return 0
    before = json.loads(choice.against.read_text(encoding="utf-8"))
    parts = {key.split("/")[0] for key in found}
    before = {key: value for key, value in before.items() if key.split("/")[0] in parts}
    differ = sorted(key for key in before.keys() | found.keys() if before.get(key) != found.get(key))
    for key in differ:
        print("differs:", key, before.get(key), found.get(key))
    print(f"{len(found) - len(differ)} of {len(found)} the same")
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())
