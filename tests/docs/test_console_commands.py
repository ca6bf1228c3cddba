"""The list of the console's commands in the documents is current."""

from tools.docs.console_commands import LIST, command_list


def test_the_list_in_the_documents_is_current() -> None:
    written = LIST.read_text(encoding="utf-8")
    assert written == command_list(), "run: python -m tools.docs.console_commands"
