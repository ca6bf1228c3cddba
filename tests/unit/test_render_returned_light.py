"""Light between a craft's parts, per frame: its 16-bit floats, and the same bytes with any number of threads."""

import os
import subprocess
import sys

import numpy as np

from simulator.render.returned_light import half_bits

_PRODUCTS = """
import hashlib, numpy as np
from simulator.render.returned_light import _weighted
from simulator.render.transfer import product_in_blocks
random = np.random.default_rng(3)
a, b = random.random((9, 128), np.float32), random.random((128, 45696), np.float32)
for made in (product_in_blocks(a, b), _weighted(a[0, :5], b[:5])):
    print(hashlib.sha256(made.tobytes()).hexdigest())
"""


def test_half_floats_are_the_nearest():
    random = np.random.default_rng(1)
    values = (10 ** random.uniform(-9, np.log10(65504), 200_000)).astype(np.float32)
    exact = values[:50_000].astype(np.float16).astype(np.float32)
    halfway = exact * np.float32(1 + 2.0**-11)
    edges = np.array([0, 2.0**-26, 2.0**-25, 2.0**-24, 2.0**-14, 65504], np.float32)
    values = np.minimum(np.concatenate([values, exact, halfway, edges]), np.float32(65504))
    np.testing.assert_array_equal(half_bits(values), values.astype(np.float16).view(np.uint16))


def test_products_do_not_depend_on_the_number_of_threads():
    # of one library's call for all columns they do: columns at its threads' borders are rounded otherwise
    hashes = {
        subprocess.run(
            [sys.executable, "-c", _PRODUCTS],
            env=os.environ | {"OPENBLAS_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "2")
    }
    assert len(hashes) == 1
