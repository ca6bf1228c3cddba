"""A target: the CubeSat of one unit under another name."""

from dataclasses import replace

import flyaround as fa


def build() -> fa.Target:
    """Return the target; named like its entry point."""
    return replace(fa.load_target("cubesat-1u"), name="example-cube", title="The example's cube")
