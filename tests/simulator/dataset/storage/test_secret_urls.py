"""A store that cannot be used is refused in one sentence that repeats no password."""

import pytest

from flyaround.simulator.dataset.storage.url_store import UrlStore
from flyaround.simulator.errors import UserError


@pytest.mark.parametrize("scheme", ["ftp", "http", "https", "sftp", "foo", "webhdfs"])
def test_a_closed_port_is_one_sentence_without_the_password(scheme):

    def use():
        store = UrlStore(f"{scheme}://user:secret@127.0.0.1:1/set?token=hidden")
        store.write([("a.txt", b"a")])  # some connect as late as here

    with pytest.raises(UserError) as caught:
        use()
    sentence = str(caught.value)
    assert f"{scheme}://***@127.0.0.1:1/set" in sentence
    assert "secret" not in sentence
    assert "hidden" not in sentence
    assert "\n" not in sentence


def test_a_title_has_no_secret():
    assert UrlStore("memory://user:secret@set/a").title == "memory://***@set/a"
