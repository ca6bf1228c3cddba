"""A network in a report goes by its file's name: files of the report are named so."""

from flyaround.hil.evaluate.method_choice import MethodChoice


def test_a_network_goes_by_its_files_name():
    assert MethodChoice("net:/some/where/tango.npz").label == "net:tango.npz"
    assert MethodChoice("net:../a/tango.npz").label == "net:tango.npz"
    assert MethodChoice("net:tango.npz").label == "net:tango.npz"
    assert MethodChoice("hybrid").label == "hybrid"
