"""The built wheel, installed outside the checkout, renders a frame."""

import json
import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

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
    where = _run(python, "-c", "import flyaround.simulator; print(flyaround.simulator.__file__)", cwd=folder)
    assert str(ROOT) not in where


@pytest.mark.gl
def test_wheel_renders_with_this_environment_s_libraries(wheel, tmp_path):
    venv.create(tmp_path / "env", with_pip=False)
    python = tmp_path / "env" / "bin" / "python"
    site = Path(
        _run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=tmp_path).strip()
    )
    # libraries from here; .pth files of another folder are not read, so the checkout stays out of reach
    (site / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n")
    _run(
        sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--quiet",
        "--ignore-installed", "--target", site, wheel, cwd=tmp_path,
    )  # fmt: skip
    _render(python, tmp_path)


@pytest.mark.gl
@pytest.mark.slow
def test_wheel_installs_with_its_own_dependencies(wheel, tmp_path):
    venv.create(tmp_path / "env", with_pip=True)
    python = tmp_path / "env" / "bin" / "python"
    _run(python, "-m", "pip", "install", "--quiet", "-c", ROOT / "constraints.txt", wheel, cwd=tmp_path)
    _render(python, tmp_path)
