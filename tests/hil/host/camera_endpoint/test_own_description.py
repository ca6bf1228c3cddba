"""The interface that is named, and a GenICam description of the user's own: served, read by Aravis, bounded."""

import io
import zipfile
from dataclasses import replace

import pytest
from camera_kit import aravis, camera, config, images, need_aravis

from flyaround.hil.host.camera_endpoint.genicam_xml import (
    MAX_UNZIPPED_BYTES,
    MAX_XML_BYTES,
    read_xml,
    write_xml,
)
from flyaround.hil.host.camera_endpoint.interface import find_interface
from flyaround.simulator.errors import UserError

# the names of another maker, on the registers of docs/hil_camera.md; shutter in milliseconds, size as one number
OWN = """<?xml version="1.0"?>
<RegisterDescription ModelName="Other" VendorName="Maker" StandardNameSpace="None" SchemaMajorVersion="1"
 SchemaMinorVersion="1" SchemaSubMinorVersion="0" MajorVersion="1" MinorVersion="0" SubMinorVersion="0"
 ProductGuid="00000000-0000-0000-0000-000000000001" VersionGuid="00000000-0000-0000-0000-000000000002">
<Category Name="Root"><pFeature>Everything</pFeature></Category>
<Category Name="Everything"><pFeature>ShutterTime</pFeature><pFeature>Columns</pFeature><pFeature>Pace</pFeature>
 <pFeature>Absent</pFeature></Category>
<Converter Name="ShutterTime"><FormulaTo>FROM*1000</FormulaTo><FormulaFrom>TO/1000</FormulaFrom>
 <pValue>ShutterReg</pValue><Unit>ms</Unit></Converter>
<FloatReg Name="ShutterReg"><Address>0xA040</Address><Length>4</Length><AccessMode>RW</AccessMode>
 <pPort>Device</pPort><Endianess>BigEndian</Endianess></FloatReg>
<Integer Name="Columns"><pValue>ColumnsReg</pValue><Min>16</Min><Max>128</Max></Integer>
<IntReg Name="ColumnsReg"><Address>0xA010</Address><Length>4</Length><AccessMode>RW</AccessMode>
 <pPort>Device</pPort><Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></IntReg>
<Float Name="Pace"><pValue>PaceReg</pValue><Min>0.1</Min><Max>120</Max></Float>
<FloatReg Name="PaceReg"><Address>0xA030</Address><Length>4</Length><AccessMode>RW</AccessMode>
 <pPort>Device</pPort><Endianess>BigEndian</Endianess></FloatReg>
<Integer Name="Absent"><pValue>AbsentReg</pValue></Integer>
<IntReg Name="AbsentReg"><Address>0xB000</Address><Length>4</Length><AccessMode>RO</AccessMode>
 <pPort>Device</pPort><Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></IntReg>
<Port Name="Device"/>
</RegisterDescription>
"""


def zipped(*texts):
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for k, text in enumerate(texts):
            archive.writestr(f"description{k}.xml", text)
    return data.getvalue()


@pytest.mark.parametrize("suffix", [".xml", pytest.param(".zip", marks=pytest.mark.slow)])
def test_aravis_reads_and_sets_the_registers_by_the_names_of_a_users_own_description(tmp_path, suffix):
    need_aravis()
    path = tmp_path / f"other maker{suffix}"
    path.write_bytes(OWN.encode() if suffix == ".xml" else zipped(OWN))
    name, xml = read_xml(path)
    assert name == f"othermaker{suffix}"
    with camera(images(), replace(config(), xml=xml, xml_name=name)):
        told = aravis("features", "Columns", "Columns=64", "Pace=12.5", "ShutterTime=2.5")
        assert told["Columns"] == 64
        assert told["Pace"] == pytest.approx(12.5)
        # and they are the camera's: the register has microseconds
        again = aravis("features", "Columns", "Pace", "ExposureTime")
        assert (again["Columns"], again["ExposureTime"]) == (64, None)


def test_interfaces_are_checked():
    with pytest.raises(UserError, match="no network interface"):
        find_interface("nothing0")
    with pytest.raises(UserError, match="not an IPv4 address"):
        find_interface("lo", "example.org")


ENTITIES = """<?xml version="1.0"?><!DOCTYPE RegisterDescription [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;">]>
<RegisterDescription ModelName="&b;"/>"""


@pytest.mark.parametrize(
    ("name", "data", "sentence"),
    [
        ("camera.txt", b"", "neither .xml nor .zip"),
        ("a.xml", b"<html/>", "outermost element is html"),
        ("a.xml", b"<RegisterDescription>", "is not XML"),
        ("a.xml", b"", "is not XML"),
        ("a.xml", ENTITIES.encode(), "document type"),
        ("a.xml", b"<!DOCTYPE r SYSTEM 'http://192.0.2.1/x'><RegisterDescription/>", "document type"),
        ("a.xml", b"<RegisterDescription>" + b"<a>" * 100, "deeper than"),
        ("a.xml", bytes(MAX_XML_BYTES + 1), "at most 1.0 MiB"),
        ("a.zip", b"PK no zip", "damaged"),
        ("a.zip", zipped(OWN, OWN), "holds 2 files"),
        ("a.zip", zipped(), "holds 0 files"),
        ("a.zip", zipped(ENTITIES), "document type"),
        ("a.zip", zipped(" " * (MAX_UNZIPPED_BYTES + 1)), "unpacks to more than 8 MiB"),
        ("a.zip", zipped(OWN)[:-40] + zipped(OWN)[-30:], "damaged"),
    ],
)
def test_a_description_that_no_client_should_read_is_refused(tmp_path, name, data, sentence):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(UserError, match=sentence):
        read_xml(tmp_path / name)


def test_what_is_written_can_be_given_back(tmp_path):
    (tmp_path / "own camera.xml").write_bytes(write_xml(config().terms))
    name, data = read_xml(tmp_path / "own camera.xml")
    assert (name, data) == ("owncamera.xml", write_xml(config().terms))
