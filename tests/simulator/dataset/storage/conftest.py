"""An S3 server of the tests' own."""

from contextlib import closing
from http.client import HTTPConnection

import pytest


@pytest.fixture
def s3(monkeypatch):
    """An S3 server with one bucket."""
    boto3 = pytest.importorskip("boto3")
    server = pytest.importorskip("moto.server").ThreadedMotoServer(
        ip_address="127.0.0.1", port=0, verbose=False
    )
    pytest.importorskip("s3fs")
    server.start()
    host, port = server.get_host_and_port()
    endpoint = f"http://{host}:{port}"
    for name, value in (
        ("AWS_ACCESS_KEY_ID", "test"),
        ("AWS_SECRET_ACCESS_KEY", "test"),
        ("AWS_DEFAULT_REGION", "us-east-1"),
        ("AWS_ENDPOINT_URL", endpoint),
    ):
        monkeypatch.setenv(name, value)
    # the servers of one process share what they keep
    with closing(HTTPConnection(host, port, timeout=60)) as line:
        line.request("POST", "/moto-api/reset")
        line.getresponse().read()
    boto3.client("s3", endpoint_url=endpoint).create_bucket(Bucket="bucket")
    yield "s3://bucket/set"
    server.stop()
    pytest.importorskip("fsspec").get_filesystem_class("s3").clear_instance_cache()
