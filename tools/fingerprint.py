"""Hashes of what Flyaround gives, to compare two states of the code: scenes, labelled frames, poses.

It speaks to the command line alone, so that it runs on any version:
`fingerprint.py all -o before.json`, then in the other state `fingerprint.py all --against before.json`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
from pathlib import Path

CLI = (sys.executable, "-m", "flyaround")
SCENES = {
    "earth-1920": ("tango-earth-10m", {}),
    "earth-1024": ("tango-earth-10m-1024", {}),
    "space": ("tango-space-10m", {}),
    "limb": ("tango-limb", {}),
    "night": ("tango-night", {}),
    "close": ("tango-close-3m", {}),
    "rgb": ("tango-earth-10m-1024", {'bands = "mono"': 'bands = "rgb"'}),
    "blur": ("tango-earth-10m-1024", {"exposure_s = 0.0009": "exposure_s = 0.02"}),
}
CAPTURES = {
    "tango-flyaround": ("tango-flyaround", "-n", "8", "--labels", "all"),
    "soyuz-earth": ("iss-orbit-limb", "-n", "6", "--seed", "71"),
    "dragon-black": ("eval-black-dragon", "-n", "6", "--seed", "72", "--labels", "all"),
}
POSES = {
    "tango": ("eval-earth", 64),
    "soyuz-ms": ("eval-black-soyuz-ms", 32),
    "dragon": ("eval-black-dragon", 32),
}


def run(*arguments: str) -> str:
    """Standard output of a command that must succeed."""
    done = subprocess.run([*CLI, *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"flyaround {' '.join(arguments)}: {done.returncode}\n{done.stderr}{done.stdout[-2000:]}")
    return done.stdout


def digest(path: Path) -> str:
    """The first 80 bits of a file's SHA-256."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:20]


def scenes(folder: Path) -> dict[str, str]:
    """Raw numbers and truth of the eight scenes."""
    found = {}
    for name, (scenario, changes) in SCENES.items():
        text = run("scenarios", "--show", scenario)
        for old, new in changes.items():
            if old not in text:
                sys.exit(f"{scenario} has no line {old}")
            text = text.replace(old, new, 1)
        file = folder / f"{name}.toml"
        file.write_text(text, encoding="utf-8")
        out = folder / f"{name}.npy"
        run("render", str(file), "-o", str(out), "-t", "7.5")
        found[f"scene/{name}.npy"] = digest(out)
        found[f"scene/{name}.json"] = digest(out.with_suffix(".json"))
    return found


def frames(folder: Path) -> dict[str, str]:
    """Every file of three small captures but the cards."""
    found = {}
    for name, arguments in CAPTURES.items():
        out = folder / name
        run("capture", *arguments, "-o", str(out))
        for path in sorted(p for p in out.rglob("*") if p.is_file()):
            if path.name not in ("dataset.json", "contact_sheet.png") and ".lock" not in path.name:
                found[f"frame/{name}/{path.relative_to(out)}"] = digest(path)
    return found


def poses(kept: Path) -> dict[str, str]:
    """Answers of the estimator, times left out, on 128 images that are made once and kept in a folder."""
    found = {}
    for target, (recipe, n) in POSES.items():
        data = kept / target
        if not (data / "dataset.json").exists():
            run("capture", recipe, "-o", str(data), "-n", str(n), "--seed", "73")
        images = sorted(str(p) for p in (data / "images").glob("*.png") if ".mask" not in p.name)
        answers = json.loads(run("estimate", *images, "--target", target, "--camera", "speed", "--json"))
        for image, answer in zip(images, answers, strict=True):
            kept_keys = (
                "accepted",
                "reason",
                "q_camera_from_target_wxyz",
                "t_camera_from_target_m",
                "confidence",
            )
            text = json.dumps({key: answer[key] for key in kept_keys})
            found[f"pose/{target}/{Path(image).name}"] = hashlib.sha256(text.encode()).hexdigest()[:20]
    return found


def main() -> int:
    """Make the hashes; with ``--against`` say what differs, and exit 1 if anything does."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("part", choices=("scenes", "frames", "poses", "all"))
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--against", type=Path)
    parser.add_argument(
        "--images", type=Path, default=Path("out/fingerprint"), help="where the 128 images are kept"
    )
    choice = parser.parse_args()
    found: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        if choice.part in ("scenes", "all"):
            found |= scenes(Path(folder))
        if choice.part in ("frames", "all"):
            found |= frames(Path(folder))
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
