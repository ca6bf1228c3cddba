"""Stores at URLs: this process's memory, and an S3 server of the tests' own."""

import socket
import uuid

import pytest

from flyaround.simulator.dataset.storage.manifest import (
    MANIFEST_NAME,
    manifest_lines,
    read_manifest,
    sort_manifest,
)
from flyaround.simulator.dataset.storage.url_store import UrlStore
from flyaround.simulator.errors import UserError

fsspec = pytest.importorskip("fsspec")


@pytest.fixture
def url():
    return f"memory://{uuid.uuid4()}/set"


def test_files_come_and_go(url):
    store = UrlStore(url + "/")
    assert store.is_empty()
    named = [("images/000000.png", b"picture"), ("images/000000.json", b"{}")]
    store.write(named[:1], named[1:])
    assert not store.is_empty()
    assert store.read("images/000000.png", 100) == b"picture"
    with pytest.raises(UserError, match="at most 3"):
        store.read("images/000000.png", 3)
    with pytest.raises(OSError, match="000001"):
        store.read("images/000001.png", 100)
    store.append(MANIFEST_NAME, manifest_lines(named))
    store.close()
    assert sorted(read_manifest(UrlStore(url))[0]) == sorted(name for name, _ in named)
    again = UrlStore(url)
    again.append(MANIFEST_NAME, b"more\n")
    again.close()
    assert again.read(MANIFEST_NAME, 1000) == manifest_lines(named) + b"more\n"
    store.remove("images/000000.json")
    store.remove("images/000000.json")
    assert not store.exists("images/000000.json")
    assert store.free_bytes() is None


def test_what_was_appended_is_read_and_put_in_order_before_it_is_written(url):
    """As at the end of a capture that was gone on with: its manifest is sorted, and closing leaves it so."""
    store = UrlStore(url)
    for k in (1, 0):
        store.append(MANIFEST_NAME, manifest_lines([(f"images/{k:06d}.json", b"{}")]))
    assert list(read_manifest(store)) == [1, 0]
    sort_manifest(store)
    store.append(MANIFEST_NAME, manifest_lines([("images/000002.json", b"{}")]))
    store.close()
    assert list(read_manifest(UrlStore(url))) == [0, 1, 2]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [("nothing://there/set", "nothing://there/set cannot be used"), ("dropbox://there/set", "package")],
)
def test_a_url_of_no_store_is_refused_in_one_sentence(wrong, words):
    with pytest.raises(UserError, match=words):
        UrlStore(wrong)


def test_a_store_that_refuses_says_so(url, monkeypatch):
    def refuses(*_, **__):
        raise PermissionError("Access Denied")

    store = UrlStore(url)
    monkeypatch.setattr(type(store._fs), "pipe", refuses)
    with pytest.raises(UserError, match=r"cannot write to memory://.*: Access Denied; check the URL"):
        store.write([("dataset.json", b"{}")])


@pytest.mark.slow
def test_an_s3_server_takes_the_same_and_a_missing_bucket_is_refused(s3):
    test_files_come_and_go(s3)
    store = UrlStore("s3://nobucket/set")
    with pytest.raises(UserError, match="cannot write to s3://nobucket/set"):
        store.write([("dataset.json", b"{}")])


@pytest.mark.slow
def test_a_server_that_does_not_answer_is_refused(s3, monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{port}")
    fsspec.get_filesystem_class("s3").clear_instance_cache()
    with pytest.raises(UserError, match="cannot reach s3://bucket/set"):
        UrlStore("s3://bucket/set")
