"""A cache entry has another name when its inputs or the source code of its makers change."""

from importlib import import_module

import numpy as np
import pytest

from flyaround.simulator.runtime.cache import entry_name


@pytest.fixture
def maker_in(tmp_path, monkeypatch):
    """Function of a module with some source code, imported from a file."""
    monkeypatch.syspath_prepend(tmp_path)

    def imported(module, source):
        (tmp_path / f"{module}.py").write_text(source)
        return import_module(module).make

    return imported


def test_the_source_of_each_maker_counts_and_its_place_does_not(maker_in):
    one = maker_in("first_maker", "def make():\n    return 1\n")
    same = maker_in("second_maker", "def make():\n    return 1\n")
    other = maker_in("third_maker", "def make():\n    return 2\n")
    name = entry_name("light", (one,), 3.0)
    assert name.startswith("light-")
    assert name == entry_name("light", (same,), 3.0)
    assert len({name, entry_name("light", (other,), 3.0), entry_name("light", (one, other), 3.0)}) == 3


def test_inputs_count_with_their_kinds(maker_in):
    make = maker_in("fourth_maker", "def make(): ...\n")
    inputs = [
        (),
        (1,),
        ("1",),
        (1.0,),
        (b"1",),
        ((1, 2),),
        (1, 2),
        (np.array([1, 2]),),
        (np.array([[1, 2]]),),
    ]
    assert len({entry_name("a", (make,), *one) for one in inputs}) == len(inputs)
    with pytest.raises(TypeError, match="set"):
        entry_name("a", (make,), {1})
