"""Interreflection per frame does not depend on the number of threads."""

import os
import sys

from programs import completed

_PRODUCTS = """
import hashlib, numpy as np
from flyaround.simulator.render.craft.interreflection import _weighted_sum
from flyaround.simulator.baking.radiance_transfer import product_in_blocks
random = np.random.default_rng(3)
a, b = random.random((9, 128), np.float32), random.random((128, 45696), np.float32)
for made in (product_in_blocks(a, b), _weighted_sum(a[0, :5], b[:5])):
    print(hashlib.sha256(made.tobytes()).hexdigest())
"""


def test_products_do_not_depend_on_the_number_of_threads():
    # of one library's call for all columns they do: columns at its threads' borders are rounded otherwise
    hashes = {
        completed(
            sys.executable, "-c", _PRODUCTS, env=os.environ | {"OPENBLAS_NUM_THREADS": threads}, check=True
        ).stdout
        for threads in ("1", "2")
    }
    assert len(hashes) == 1
