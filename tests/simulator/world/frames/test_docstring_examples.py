"""Examples in docstrings run as doctests."""

import doctest

import pytest

from flyaround.simulator.world.frames import pose


@pytest.mark.parametrize("module", [pose])
def test_docstring_examples_pass(module):
    result = doctest.testmod(module)
    assert result.attempted > 0
    assert result.failed == 0
