"""The examples in docstrings say what the code does."""

import doctest

import pytest

from flyaround.simulator.world.frames import pose


@pytest.mark.parametrize("module", [pose])
def test_examples(module):
    result = doctest.testmod(module)
    assert result.attempted > 0
    assert result.failed == 0
