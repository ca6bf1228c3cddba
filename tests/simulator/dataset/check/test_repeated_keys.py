"""JSON text on which readers disagree is refused by one sentence."""

import pytest

from flyaround.simulator.dataset.check.export_contents import refuse_repeated_keys
from flyaround.simulator.errors import UserError


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b'{"a": 1, "a": 2}', "a.json: key 'a' occurs twice; remove one"),
        (b"[" * 30_000, "a.json nests more than"),
        (b"{", "a.json is not JSON"),
        (b"", "a.json is not JSON"),
    ],
)
def test_what_is_wrong_is_said(data, message):
    with pytest.raises(UserError, match=message):
        refuse_repeated_keys(data, "a.json")


def test_text_with_a_byte_order_mark_is_read():
    refuse_repeated_keys(b'\xef\xbb\xbf{"a": {"a": 1}}', "a.json")
