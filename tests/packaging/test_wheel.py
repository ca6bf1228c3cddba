"""The built wheel, installed outside the checkout, renders a frame."""

import json
import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

from flyaround.__main__ import run
from flyaround.hil.board.hybrid.native import library

ROOT = Path(__file__).parents[2]


def _run(*command, cwd, **environment):
    clean = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | environment
    done = subprocess.run(
        [str(c) for c in command],
        cwd=cwd,
        env=clean,
        capture_output=True,
        text=True,
        check=False,
        timeout=280,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    _run(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder, ROOT, cwd=folder)
    return next(folder.glob("*.whl"))


NATIVE = "flyaround/hil/board/hybrid/native"


def test_the_wheel_is_of_its_platform_and_carries_its_libraries_and_those_of_boards(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    libraries = {Path(name).name for name in names if name.startswith(f"{NATIVE}/lib/")}
    assert wheel.name.split("-")[2:4] == ["py3", "none"]
    assert not wheel.stem.endswith("-any")
    assert library.choose_library() in libraries
    assert {"linux-x86_64.so", "linux-aarch64.so", "linux-armv7.so", library.CHECKSUMS} <= libraries
    assert not [
        name for name in libraries if name.startswith(("macos", "windows")) and sys.platform == "linux"
    ]
    assert f"{NATIVE}/kernels.h" in names
    assert not [name for name in names if name.startswith(NATIVE) and name.endswith(".c")]


def test_an_unknown_platform_is_refused_in_one_sentence(tmp_path):
    environment = os.environ | {"FLYAROUND_WHEEL_PLATFORM": "amiga-m68k"}
    done = subprocess.run(
        [sys.executable, ROOT / "hatch_build.py"],
        capture_output=True, text=True, check=False, env=environment, cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.startswith(
        "no wheel can be made for 'amiga-m68k': set FLYAROUND_WHEEL_PLATFORM to one of linux-"
    )


def _installed(wheel, folder):
    """Python of a new environment with the wheel and this environment's libraries."""
    venv.create(folder / "env", with_pip=False)
    python = folder / "env" / "bin" / "python"
    site = Path(
        _run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=folder).strip()
    )
    # libraries from here; .pth files of another folder are not read, so the checkout stays out of reach
    (site / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n")
    _run(
        sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--quiet",
        "--ignore-installed", "--target", site, wheel, cwd=folder,
    )  # fmt: skip
    return python


@pytest.mark.gl
@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_poses_of_the_wheel_without_a_compiler_are_the_checkout_s_to_the_bit(wheel, tmp_path):
    python, folder = _installed(wheel, tmp_path), tmp_path / "set"
    assert run(["capture", "eval-black", "-n", "12", "--quality", "draft", "-o", str(folder)]) == 0
    images = sorted(str(p) for p in (folder / "images").glob("??????.png"))
    camera = tmp_path / "camera.json"
    camera.write_text(json.dumps(json.loads(Path(images[0]).with_suffix(".json").read_text())["camera"]))
    command = ["-m", "flyaround", "estimate", *images, "--camera", camera, "--json"]
    told = [
        json.loads(_run(python, *command, cwd=tmp_path, PATH=str(tmp_path))),
        json.loads(_run(sys.executable, *command, cwd=ROOT)),
    ]
    for answer in (*told[0], *told[1]):
        del answer["stages_ms"]
    assert len(told[0]) == 12
    assert told[0] == told[1]
    assert told[0][0]["kernels"] == f"native ({library.choose_library()})"


def _render(python, folder):
    _run(
        python,
        "-m",
        "flyaround",
        "render",
        "tango-earth-10m",
        "-t",
        "1",
        "-o",
        "frame.png",
        "--quality",
        "draft",
        cwd=folder,
    )
    truth = json.loads((folder / "frame.json").read_text())
    assert truth["box_px"] is not None
    where = _run(python, "-c", "import flyaround.simulator as s; print(s.__file__)", cwd=folder)
    assert str(ROOT) not in where


@pytest.mark.gl
def test_wheel_renders_with_this_environment_s_libraries(wheel, tmp_path):
    python = _installed(wheel, tmp_path)
    _render(python, tmp_path)


@pytest.mark.gl
@pytest.mark.slow
def test_wheel_installs_with_its_own_dependencies(wheel, tmp_path):
    venv.create(tmp_path / "env", with_pip=True)
    python = tmp_path / "env" / "bin" / "python"
    _run(python, "-m", "pip", "install", "--quiet", "-c", ROOT / "constraints.txt", wheel, cwd=tmp_path)
    _render(python, tmp_path)
