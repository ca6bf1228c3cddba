"""The example package, installed into a folder of its own, one of each kind used by name; and broken packages."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from programs import completed

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.plugins import plugins

PACKAGE = Path(__file__).parents[2] / "examples" / "plugin_package"


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("installed")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-index"]
    subprocess.run(
        [*pip, "--no-deps", "--no-build-isolation", "--target", str(folder), str(PACKAGE)],
        check=True,
        env={**os.environ, "PIP_NO_CACHE_DIR": "1"},
        timeout=200,
    )
    return folder


def flyaround(folder, *words, cwd):
    return completed(
        sys.executable, "-m", "flyaround", *words, cwd=cwd, env={**os.environ, "PYTHONPATH": str(folder)}
    )


@pytest.mark.gl
def test_one_of_each_kind_is_found_and_used(installed, tmp_path):
    listed = flyaround(installed, "plugins", "--json", cwd=tmp_path)
    assert listed.returncode == 0, listed.stderr
    rows = json.loads(listed.stdout)
    assert {(row["kind"], row["name"]) for row in rows} == {
        ("sensor", "rangefinder"),
        ("format", "pose-list"),
        ("recipe", "example-near"),
        ("estimator", "brightest"),
        ("target", "example-cube"),
        ("body", "mars"),
    }
    assert {(row["package"], row["version"], row["problem"]) for row in rows} == {
        ("flyaround-example", "1.0", "")
    }

    words = ("capture", "example-near", "-o", "cubes", "--sensors", "rangefinder", "--format", "pose-list")
    taken = flyaround(installed, *words, cwd=tmp_path)
    assert taken.returncode == 0, taken.stderr
    card = json.loads((tmp_path / "cubes" / "dataset.json").read_text())
    assert (card["target"]["name"], card["sensors"]) == ("example-cube", ["rangefinder"])
    lines = (tmp_path / "cubes" / "pose-list" / "poses.txt").read_text().splitlines()
    for k in range(2):
        truth = json.loads((tmp_path / "cubes" / "images" / f"{k:06d}.json").read_text())
        with np.load(tmp_path / "cubes" / "images" / f"{k:06d}.rangefinder.npz") as measured:
            depth = measured["depth_m"]
        # the nearest point is within the reach of its antennas
        assert abs(np.nanmin(depth) - truth["t_camera_from_target_m"][2]) < 0.7
        assert float(lines[k + 1].split()[-1]) == truth["t_camera_from_target_m"][2]

    judged = flyaround(
        installed, "evaluate", "cubes", "-o", "report", "--method", "brightest", "--json", cwd=tmp_path
    )
    assert judged.returncode == 0, judged.stderr
    metrics = json.loads(judged.stdout)
    assert metrics["n_accepted"] == 0
    assert metrics["mean_E_T_m_all"] < 1.2


def test_the_page_of_bodies_has_the_examples_code():
    code = (PACKAGE / "flyaround_example" / "mars.py").read_text()
    assert code in (PACKAGE.parents[1] / "docs" / "own_body.md").read_text()
    assert len(code.splitlines()) < 100


def broken(folder, kind, name, value, module=""):
    """A package as `pip install --target` leaves one, of one module."""
    info = folder / f"broken_{kind}-2.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: broken-{kind}\nVersion: 2.0\n")
    (info / "entry_points.txt").write_text(f"[flyaround.{kind}s]\n{name} = {value}\n")
    (folder / f"broken_{kind}.py").write_text(module)


def test_a_broken_package_is_a_sentence_that_names_it(tmp_path, monkeypatch, capsys):
    from flyaround.__main__ import run

    broken(tmp_path, "sensor", "bad-sensor", "broken_sensor:measure", "import no_such_module")
    broken(tmp_path, "estimator", "bad-estimator", "broken_estimator:make", "make = 1 / 0")
    broken(tmp_path, "target", "bad-target", "broken_target:build", "def build():\n    return 3")
    broken(tmp_path, "recipe", "bad-recipe", "broken_recipe:FILE", "FILE = 5")
    monkeypatch.syspath_prepend(str(tmp_path))
    out = str(tmp_path / "out")
    for words, package in (
        (["capture", "eval-black", "-n", "1", "-o", out, "--sensors", "bad-sensor"], "broken-sensor 2.0"),
        (["capture", "eval-black", "-n", "1", "-o", out, "--sensors", "none"], "bad-sensor"),
        (["capture", "eval-black", "-n", "1", "-o", out, "--target", "bad-target"], "broken-target 2.0"),
        (["capture", "bad-recipe", "-n", "1", "-o", out], "broken-recipe 2.0"),
        (["estimate", "x.png", "--method", "bad-estimator"], "broken-estimator 2.0"),
    ):
        assert run(words) == 2, words
        error = " ".join(capsys.readouterr().err.split())
        assert package in error
        assert "Traceback" not in error
    assert not (tmp_path / "out").exists()
    # the list says so too, and is no failure
    assert run(["plugins", "--json"]) == 0
    rows = {row["name"]: row["problem"] for row in json.loads(capsys.readouterr().out)}
    assert "no_such_module" in rows["bad-sensor"]
    assert "division" in rows["bad-estimator"]
    with pytest.raises(UserError, match="pip uninstall broken-sensor"):
        plugins("sensor")["bad-sensor"].load()


def test_without_packages_there_is_nothing_and_built_in_names_stay(tmp_path, monkeypatch, capsys):
    from flyaround.__main__ import run
    from flyaround.simulator.scenario.load import list_recipes, load_recipe
    from flyaround.simulator.targets.library import load_target

    assert run(["plugins"]) == 0
    assert "no installed package" in " ".join(capsys.readouterr().out.split())
    broken(tmp_path, "recipe", "eval-black", "broken_recipe:FILE", "import no_such_module")
    broken(tmp_path, "target", "tango", "broken_target:build", "import no_such_module")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert list_recipes().count("eval-black") == 1
    assert load_recipe("eval-black").target == "tango"
    assert load_target("tango").name == "tango"
