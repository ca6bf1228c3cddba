"""The interface that is named, and a GenICam description of the user's own."""

import pytest

from hil.host.camera_endpoint.genicam_xml import read_xml
from hil.host.camera_endpoint.interface import find_interface
from simulator.errors import UserError


def test_interfaces_and_descriptions_are_checked(tmp_path):
    with pytest.raises(UserError, match="no network interface"):
        find_interface("nothing0")
    with pytest.raises(UserError, match="no IPv4 address"):
        find_interface("lo", "example.org")
    with pytest.raises(UserError, match="neither"):
        read_xml(tmp_path / "camera.txt")
    (tmp_path / "own camera.xml").write_text("<RegisterDescription/>")
    assert read_xml(tmp_path / "own camera.xml") == ("owncamera.xml", b"<RegisterDescription/>")
    (tmp_path / "own camera.xml").write_text("<html/>")
    with pytest.raises(UserError, match="RegisterDescription"):
        read_xml(tmp_path / "own camera.xml")
