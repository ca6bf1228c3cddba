"""A network in a report goes by its file's name: files of the report are named so."""

from pathlib import Path

from hil.evaluate.method_choice import MethodChoice


def test_a_network_goes_by_its_files_name() -> None:
    assert MethodChoice("net:/some/where/tango.onnx").label == "net:tango.onnx"
    assert Path(MethodChoice("net:../a/tango.onnx").label).name == "net:tango.onnx"
    assert MethodChoice("svd").label == "svd"
