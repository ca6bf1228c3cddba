"""The board's bundle, and its program under what boards really have."""

import json
import os
import shutil
import socket
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from programs import completed

import flyaround.hil
from flyaround.__main__ import run
from flyaround.hil.board.__main__ import main

ROOT = Path(flyaround.hil.__path__[0])


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    path = tmp_path_factory.mktemp("bundle") / "board.pyz"
    assert run(["hil", "bundle", str(path), "--target", "tango", "--target", "cubesat-3u"]) == 0
    return path


def test_the_bundle_is_small_whole_and_the_same_again(bundle, tmp_path):
    # the network's trunk, and a head for each craft
    assert bundle.stat().st_size < 2_150_000 + 6_100_000 + 2 * 500_000
    names = zipfile.ZipFile(bundle).namelist()
    assert {
        "__main__.py",
        "serial/serialposix.py",
        "flyaround/hil/board/models/cubesat-3u.board.json",
        "flyaround/hil/board/hybrid/native/kernels.h",
        *(
            f"flyaround/hil/board/hybrid/native/lib/linux-{name}.so"
            for name in ("x86_64", "aarch64", "armv7")
        ),
    } <= set(names)
    assert sum(name.startswith("flyaround/hil/board/hybrid/") for name in names) >= 30
    assert sum(name.startswith("flyaround/hil/board/svd/") for name in names) >= 10
    weights = "flyaround/hil/board/hybrid/propose/keypoints/weights"
    assert {f"{weights}/trunk.onnx", f"{weights}/tango.npz"} <= set(names)
    # heads of its crafts alone
    assert f"{weights}/soyuz-ms.npz" not in names
    assert not any(
        name.startswith(("flyaround/simulator", "flyaround/gui", "flyaround/hil/host")) for name in names
    )
    assert (
        run(["hil", "bundle", str(tmp_path / "again.pyz"), "--target", "tango", "--target", "cubesat-3u"])
        == 0
    )
    assert (tmp_path / "again.pyz").read_bytes() == bundle.read_bytes()


def test_mistakes_are_told_in_one_sentence(tmp_path, capsys, bundle):
    assert run(["hil", "bundle", str(tmp_path)]) == 2
    assert "is a folder" in capsys.readouterr().err
    assert run(["hil", "bundle", str(tmp_path / "b.pyz"), "--target", "teapot"]) == 2
    assert "teapot" in capsys.readouterr().err
    assert main(["tcp://127.0.0.1:9", "--model", str(tmp_path / "none.json")]) == 2
    assert "none.json" in capsys.readouterr().err
    assert main(["tcp://127.0.0.1:9", "--model", "x", "--method", "guess"]) == 2
    assert "unknown method" in capsys.readouterr().err
    answer = completed(sys.executable, bundle, "--model", "tango", "--image", "a.png")
    assert answer.returncode == 2
    assert "--camera" in answer.stderr


def test_the_bundle_leaves_nothing_behind(bundle, tmp_path):
    temporary, cache = tmp_path / "tmp", tmp_path / "cache"
    temporary.mkdir()
    environment = {**os.environ, "TMPDIR": str(temporary), "FLYAROUND_CACHE_DIR": str(cache), "PATH": ""}
    words = ["tcp://127.0.0.1:1", "--model", "tango", "--timeout", "0.1"]
    done = completed(sys.executable, bundle, *words, env=environment, cwd=tmp_path)
    assert done.returncode == 4, done.stderr
    assert list(temporary.iterdir()) == []
    assert not cache.exists()


def newest_python_needed(*paths):
    """What vermin says of files that must run on Python 3.9; its exit code is not 0 when they need a later one."""
    command = [str(Path(sys.executable).with_name("vermin")), "-t=3.9-", "--no-tips", "--violations"]
    return completed(*command, *map(str, paths))


def test_the_boards_code_is_python_39(tmp_path):
    said = newest_python_needed(ROOT / "board", ROOT / "link", ROOT / "__init__.py")
    assert said.returncode == 0, said.stdout
    # and the guard sees what is later
    late = tmp_path / "late.py"
    late.write_text("match 1:\n  case 1: zip([1], [2], strict=True)\n")
    assert newest_python_needed(late).returncode != 0


DEBIAN = "/usr/bin/python3"


def debian_has_opencv():
    """Whether Debian's own Python has numpy and OpenCV; installed where this process may."""
    probe = [DEBIAN, "-I", "-c", "import cv2, numpy"]
    if not Path(DEBIAN).exists() or shutil.which("apt-get") is None:
        return False
    if subprocess.run(probe, capture_output=True, check=False).returncode == 0:
        return True
    if os.geteuid() != 0:
        return False
    install = ["apt-get", "install", "-y", "--no-install-recommends", "python3-opencv", "python3-numpy"]
    subprocess.run(install, capture_output=True, check=False, timeout=280)
    return subprocess.run(probe, capture_output=True, check=False).returncode == 0


@pytest.mark.slow
@pytest.mark.gl
@pytest.mark.timeout(900)
def test_the_bundle_runs_on_debians_python_and_opencv(bundle, tmp_path):
    """Debian 12: Python 3.11 with numpy 1.24 and OpenCV 4.6, nothing of this project's environment."""
    if not debian_has_opencv():
        pytest.skip("this machine has no Debian python3-opencv, and this user may not install it")
    folder = tmp_path / "set"
    assert run(["capture", "eval-black", "-n", "3", "--seed", "77", "-o", str(folder)]) == 0
    right = 0
    for k in range(3):
        truth = json.loads((folder / "images" / f"{k:06d}.json").read_text())
        camera = tmp_path / "camera.json"
        camera.write_text(json.dumps(truth["camera"]))
        image = str(folder / "images" / f"{k:06d}.png")
        for method in ("hybrid", "svd-thesis"):
            command = f"{DEBIAN} -I {bundle} --model tango --image {image} --camera {camera}".split()
            answer = completed(*command, "--method", method, cwd=tmp_path)
            assert answer.returncode == 0, answer.stderr
            pose = json.loads(answer.stdout)
            assert not pose["reason"].startswith("internal")
            if method == "hybrid" and pose["accepted"]:
                E_T = np.subtract(pose["t_camera_from_target_m"], truth["t_camera_from_target_m"])
                assert np.linalg.norm(E_T) < 0.05 * np.linalg.norm(truth["t_camera_from_target_m"])
                right += 1
    assert right >= 1
    # and a session with a host, tracking
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    url = f"tcp://127.0.0.1:{port}"
    board = subprocess.Popen(
        [DEBIAN, "-I", str(bundle), url, "--model", "tango", "--method", "hybrid-track", "--silence", "60"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    )
    log = tmp_path / "log"
    host = [sys.executable, "-m", "flyaround", "hil", "host", "tango-flyaround", "--listen", url, "-n", "4"]
    told = completed(*host, "--log", log, "--timeout", "60", "--silence", "60", cwd=ROOT.parent)
    assert told.returncode == 0, told.stderr
    out, err = board.communicate(timeout=200)
    assert board.returncode == 0, err
    assert "of 4 poses accepted" in out
    assert len((log / "frames.csv").read_text().splitlines()) == 5
