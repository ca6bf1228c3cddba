"""Processes that are told a target's name with each frame read it once: reading took two thirds of a frame."""

import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets import library

NAME = "cubesat-1u"


@pytest.fixture
def reads(monkeypatch):
    names = []
    read = library.target_from

    def count(data, path, **options):
        names.append(path.name)
        return read(data, path, **options)

    monkeypatch.setattr(library, "target_from", count)
    library.target_in_use.cache_clear()
    yield names
    library.target_in_use.cache_clear()


def test_a_target_in_use_is_the_same_object_and_another_is_not_taken_for_it(reads):
    sha256 = library.load_target(NAME).sha256
    reads.clear()
    first = library.target_in_use(NAME, sha256)
    assert library.target_in_use(NAME, sha256) is first
    assert len(reads) == 1
    for _ in range(2):  # looked for each time: it may have come back
        with pytest.raises(UserError, match="has changed"):
            library.target_in_use(NAME, "of another")
    assert len(reads) == 3
