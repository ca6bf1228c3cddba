"""One package is installed, from the wheel and from the source archive alike."""

import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("assets", "gui", "hil", "shaders", "simulator")


def run(*command, cwd, check=True):
    done = subprocess.run(
        [str(one) for one in command],
        cwd=cwd,
        env={"PATH": "/nowhere", "HOME": str(cwd)},
        capture_output=True,
        text=True,
        check=False,
    )
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
