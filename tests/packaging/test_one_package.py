"""One package is installed, from the wheel and from the source archive alike, and draws and estimates as a checkout."""

import json
import os
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest
from programs import completed

import flyaround.__main__ as command_line
from flyaround.hil.board.hybrid.native import library

ROOT = Path(__file__).parents[2]
NATIVE = "flyaround/hil/board/hybrid/native"
FOLDERS = ("assets", "gui", "hil", "shaders", "simulator")


def run(*command, cwd, home=None, check=True):
    done = completed(*command, cwd=cwd, timeout=None, env={"PATH": "/nowhere", "HOME": str(home or cwd)})
    assert not check or done.returncode == 0, done.stdout + done.stderr
    return done


def build(kind, source, folder):
    subprocess.run(
        [sys.executable, "-m", "build", f"--{kind}", "--no-isolation", "--outdir", folder, source],
        cwd=folder,
        capture_output=True,
        check=True,
    )
    return next(folder.glob("*.whl" if kind == "wheel" else "*.tar.gz"))


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    return build("wheel", ROOT, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory):
    """An environment with the wheel's contents alone, and this one's libraries behind them."""
    home = tmp_path_factory.mktemp("env")
    venv.create(home / "env", with_pip=False)
    interpreter = home / "env" / "bin" / "python"
    site = Path(
        run(
            interpreter, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=home
        ).stdout.strip()
    )
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)  # noqa: S202 - our own archive
    # .pth files of another folder are not read, so the checkout stays out of reach
    (site / "libraries.pth").write_text(
        "\n".join(one for one in sys.path if one.endswith("-packages")) + "\n"
    )
    return interpreter


def test_one_package_and_its_metadata_are_installed(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    tops = {name.split("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"flyaround"}
    assert len(tops) == 2
    assert "flyaround/py.typed" in names
    for folder in FOLDERS:
        assert any(name.startswith(f"flyaround/{folder}/") for name in names)


def test_the_wheel_is_of_its_platform_and_carries_its_libraries_and_those_of_boards(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    libraries = {Path(name).name for name in names if name.startswith(f"{NATIVE}/lib/")}
    assert wheel.name.split("-")[2:4] == ["py3", "none"]
    assert not wheel.stem.endswith("-any")
    assert {library.choose_library(), library.CHECKSUMS} <= libraries
    assert {"linux-x86_64.so", "linux-aarch64.so", "linux-armv7.so"} <= libraries
    assert sys.platform != "linux" or not [n for n in libraries if n.startswith(("macos", "windows"))]
    assert f"{NATIVE}/kernels.h" in names
    assert not [name for name in names if name.startswith(NATIVE) and name.endswith(".c")]


def test_an_unknown_platform_is_refused_in_one_sentence(tmp_path):
    environment = os.environ | {"FLYAROUND_WHEEL_PLATFORM": "amiga-m68k"}
    command = [sys.executable, ROOT / "hatch_build.py"]
    done = completed(*command, env=environment, cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr.startswith("no wheel can be made for 'amiga-m68k': set FLYAROUND_WHEEL_PLATFORM to")


def test_every_module_is_imported_and_the_folders_names_are_free(python, tmp_path):
    code = """
import importlib, pkgutil, sys, flyaround
for module in pkgutil.walk_packages(flyaround.__path__, "flyaround."):
    if not module.name.endswith("__main__"):
        try:
            importlib.import_module(module.name)
        except ModuleNotFoundError as error:  # of an extra that is not installed
            assert not error.name.startswith("flyaround"), error
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
    except ImportError:
        continue
    raise SystemExit(f"{name} can be imported")
print(flyaround.__file__)
"""
    done = run(python, "-W", "error::SyntaxWarning", "-c", code, *FOLDERS, cwd=tmp_path)
    assert str(ROOT) not in done.stdout


@pytest.mark.gl
def test_a_script_beside_folders_of_the_same_names_draws(python, tmp_path):
    for folder in FOLDERS:
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "__init__.py").write_text("raise ImportError('a user\\'s own folder')\n")
    script = tmp_path / "draw.py"
    script.write_text(
        "import flyaround as fa\n"
        "plan = fa.plan_flight(fa.load_scenario('tango-space-10m'), n=1)\n"
        "with fa.Renderer() as renderer:\n"
        "    frame = fa.take_frame(renderer, plan.scene(0), plan.target)\n"
        "print(frame.image.shape, frame.image.max() > 0)\n"
    )
    assert "True" in run(python, script, cwd=tmp_path).stdout


@pytest.mark.gl
@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_poses_of_the_wheel_without_a_compiler_are_the_checkout_s_to_the_bit(python, tmp_path):
    folder = tmp_path / "set"
    words = ["capture", "eval-black", "-n", "12", "--quality", "draft", "-o", str(folder)]
    assert command_line.run(words) == 0
    images = sorted(str(p) for p in (folder / "images").glob("??????.png"))
    camera = tmp_path / "camera.json"
    camera.write_text(json.dumps(json.loads(Path(images[0]).with_suffix(".json").read_text())["camera"]))
    command = ["-m", "flyaround", "estimate", *images, "--camera", camera, "--json"]
    wheels = json.loads(run(python, *command, cwd=tmp_path).stdout)
    # by the same kernels of BLAS: which they are may be set in the environment
    ours = json.loads(run(sys.executable, *command, cwd=ROOT, home=tmp_path).stdout)
    for answer in (*wheels, *ours):
        del answer["stages_ms"]
    assert len(wheels) == 12
    assert wheels == ours
    assert wheels[0]["kernels"] == f"native ({library.choose_library()})"


@pytest.mark.gl
@pytest.mark.slow
def test_the_wheel_installs_with_its_own_dependencies(wheel, tmp_path):
    venv.create(tmp_path / "env", with_pip=True)
    python = tmp_path / "env" / "bin" / "python"
    command = [python, "-m", "pip", "install", "--quiet", "-c", ROOT / "constraints.txt", wheel]
    subprocess.run(command, check=True, cwd=tmp_path)
    words = ["render", "tango-earth-10m", "-t", "1", "-o", "frame.png", "--quality", "draft"]
    run(python, "-m", "flyaround", *words, cwd=tmp_path)
    assert json.loads((tmp_path / "frame.json").read_text())["box_px"] is not None


@pytest.mark.slow
def test_the_source_archive_gives_the_same_wheel(wheel, tmp_path):
    archive = build("sdist", ROOT, tmp_path)
    with tarfile.open(archive) as tar:
        tar.extractall(tmp_path, filter="data")
    source = next(path for path in tmp_path.iterdir() if path.is_dir())
    again = build("wheel", source, tmp_path)

    def contents(path):
        with zipfile.ZipFile(path) as archive:
            return {
                one.filename: one.CRC for one in archive.infolist() if not one.filename.endswith("RECORD")
            }

    assert contents(again) == contents(wheel)
