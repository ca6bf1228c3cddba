"""Small faults in the layers of a frame that is drawn again: record and hash agree, rays through samples miss them."""

import json
import shutil

import cv2
import numpy as np
import pytest
from small_flight import small_flight

from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.check.verify import check_dataset
from flyaround.simulator.dataset.formats.exr import encode_exr
from flyaround.simulator.dataset.formats.native import (
    EXR_CHANNELS,
    frame_paths,
    layer_path,
    read_layer,
    read_png,
)
from flyaround.simulator.labels.layers import layer_hash
from flyaround.simulator.labels.request import LAYERS

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    folder = tmp_path_factory.mktemp("layers") / "set"
    capture(small_flight(320, times=(20.0, 35.0)), folder, labels=LAYERS)
    return folder


def patch(change, size=12):
    """Change a patch in the middle of the craft."""

    def spoil(layer, mask):
        rows, columns = (int(np.median(x)) for x in np.nonzero(mask))
        layer = layer.copy()
        where = np.s_[rows - size // 2 : rows + size // 2, columns - size // 2 : columns + size // 2]
        layer[where] = change(layer[where])
        return layer

    return spoil


FAULTS = {
    "clean lighter by 3 DN": ("clean", lambda x, _: cv2.add(x, 3)),
    "clean times 0.97": ("clean", lambda x, _: np.rint(x * 0.97).astype(x.dtype)),
    "depth patch 5 cm off": ("depth", patch(lambda z: z + np.float32(0.05))),
    "depth patch 1 cm off": ("depth", patch(lambda z: z + np.float32(0.01))),
    "depth patch flat": ("depth", patch(lambda z: np.full_like(z, np.nanmean(z)))),
    "normals of a patch": ("normals", patch(lambda n: n[..., [1, 0, 2]])),
    "parts of a patch": ("parts", patch(lambda p: np.where(p > 0, p % p.max() + 1, p).astype(p.dtype))),
    "flow of a patch": ("flow", patch(lambda f: f + np.float32(0.5))),
}


@pytest.mark.parametrize("kind", FAULTS)
def test_a_small_fault_in_a_layer_is_found(original, tmp_path, kind):
    name, change = FAULTS[kind]
    folder = shutil.copytree(original, tmp_path / "set")
    (folder / "manifest.sha256").unlink()
    mask = read_png(frame_paths(folder, 0).mask)
    layer = change(read_layer(folder / "images", "000000", name), mask)
    path = layer_path(folder / "images", "000000", name)
    if name in EXR_CHANNELS:
        path.write_bytes(encode_exr(EXR_CHANNELS[name], layer))
    else:
        cv2.imwrite(str(path), layer)
    record = json.loads(frame_paths(folder, 0).truth.read_text())
    record["layer_sha256"][name] = layer_hash(name, layer, mask)
    frame_paths(folder, 0).truth.write_text(json.dumps(record))
    faults = [(fault.frame, fault.what) for fault in check_dataset(folder, redraw=1).faults]
    assert any(frame == 0 and what.startswith(name) for frame, what in faults)


def test_fresh_layers_have_no_fault(original):
    assert check_dataset(original, redraw=1).faults == ()
