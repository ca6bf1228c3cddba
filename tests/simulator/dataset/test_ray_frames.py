"""Frames drawn by a Ray cluster of local nodes: the bytes of one process, also when a node is lost."""

import dataclasses
import os
import socket

import msgspec
import pytest

from flyaround.simulator.dataset import ray_frames
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.ray_frames import RayCluster
from flyaround.simulator.errors import UserError
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.scene.second_camera import SecondCamera

pytestmark = pytest.mark.gl

N = 12
NODES_S = 240.0


def _plan(n=N):
    made = plan_recipe("eval-black", n, target="tango@low", quality="draft")
    return dataclasses.replace(made, camera=made.camera.resized(384))


def _files(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_an_address_that_does_not_answer_is_refused_in_one_sentence(tmp_path):
    pytest.importorskip("ray")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(UserError, match=f"no Ray cluster answers at 127.0.0.1:{port}: .*; start one with"):
        capture(_plan(), tmp_path / "set", cluster=RayCluster(f"127.0.0.1:{port}"))
    assert list(tmp_path.iterdir()) == []
    for wrong in ("here", "http://there:80", "there:notaport"):
        with pytest.raises(UserError, match="is not an address; give auto, HOST:PORT"):
            capture(_plan(), tmp_path / "set", cluster=RayCluster(wrong))


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    folder = tmp_path_factory.mktemp("alone") / "set"
    capture(_plan(), folder)
    return folder


@pytest.fixture
def cluster(monkeypatch):
    """A head that draws nothing."""
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    monkeypatch.setenv("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    monkeypatch.setenv("RAY_DISABLE_MEMORY_MONITOR", "1")
    pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    memory = {"object_store_memory": 150_000_000}
    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, **memory})

    def add_nodes(count):
        """Nodes of one processor each; on a crowded machine they take longer than the cluster itself would wait."""
        nodes = [made.add_node(wait=False, num_cpus=1, **memory) for _ in range(count)]
        made.wait_for_nodes(timeout=NODES_S)
        return nodes

    made.flyaround_nodes = add_nodes
    yield made
    made.shutdown()


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.filterwarnings("default")
def test_four_nodes_give_the_bytes_of_one_process(cluster, alone, tmp_path):
    cluster.flyaround_nodes(4)
    summary = capture(_plan(), tmp_path / "set", cluster=RayCluster(cluster.address))
    assert summary.n_written == N
    assert _files(tmp_path / "set") == _files(alone)
    with pytest.raises(UserError, match="requests GPUs, but the Ray cluster"):
        capture(_plan(), tmp_path / "other", cluster=RayCluster(cluster.address, gpu_share=0.5))


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.filterwarnings("default")
def test_a_node_that_is_lost_costs_no_frame(cluster, alone, monkeypatch):
    """Two nodes; one is killed, and what it has under way with it, after the first frames came."""
    nodes = cluster.flyaround_nodes(2)
    killed = []

    def kill(done, _of):
        if done == 2:
            cluster.remove_node(nodes[0], allow_graceful=False)
            killed.append(done)

    url = f"memory://lost-{os.getpid()}/set"
    monkeypatch.setattr(ray_frames, "MAX_IN_SHARD", 2)
    summary = capture(_plan(), url, cluster=RayCluster(cluster.address), progress=kill)
    assert killed
    assert (summary.n_written, summary.quarantined) == (N, ())
    fsspec = pytest.importorskip("fsspec")
    memory = fsspec.filesystem("memory")
    root = url.removeprefix("memory:/")
    written = {path.removeprefix(root + "/"): memory.cat_file(path) for path in memory.find(root)}
    assert written == _files(alone)


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.filterwarnings("default")
def test_a_frame_that_cannot_be_drawn_there_is_said_as_here(cluster, tmp_path):
    cluster.flyaround_nodes(1)
    plan = _plan(2)
    broken = dataclasses.replace(
        plan.scene(1), target=dataclasses.replace(plan.scene(1).target, sha256="0" * 64)
    )
    object.__setattr__(plan, "scene", lambda k: broken if k else type(plan).scene(plan, k))
    with pytest.raises(UserError, match="target"):
        capture(plan, tmp_path / "set", cluster=RayCluster(cluster.address))


PACKAGE = """
import numpy as np


def measure(frame, rng):
    return {"depth_m": np.nanmin(frame.depth_m) + rng.normal(0, 0.01, 3)}
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package with a sensor, for this process and for those of a cluster that is begun afterwards."""
    info = tmp_path / "installed" / "ranger-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: ranger\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[flyaround.sensors]\nranger = ranger:measure\n")
    (info.parent / "ranger.py").write_text(PACKAGE)
    monkeypatch.syspath_prepend(str(info.parent))
    monkeypatch.setenv("PYTHONPATH", str(info.parent), prepend=os.pathsep)
    return "ranger"


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.filterwarnings("default")
def test_stereo_pairs_and_sensors_of_packages_have_the_bytes_of_one_process(package, cluster, tmp_path):
    made = plan_recipe("eval-black", 4, target="tango@low", quality="draft")
    pair = msgspec.structs.replace(made.recipe, second_camera=SecondCamera(position_m=(0.4, 0.0, 0.0)))
    plan = dataclasses.replace(made, recipe=pair, camera=made.camera.resized(384))
    capture(plan, tmp_path / "alone", sensors=(package,))
    cluster.flyaround_nodes(2)
    summary = capture(plan, tmp_path / "set", sensors=(package,), cluster=RayCluster(cluster.address))
    assert summary.second is not None
    assert (summary.n_written, summary.second.n_written) == (4, 4)
    files = _files(tmp_path / "set")
    assert {"images/000003.ranger.npz", "second/images/000003.ranger.npz"} <= set(files)
    assert files == _files(tmp_path / "alone")
