"""Printable URLs, without passwords and tokens."""

from __future__ import annotations

import re

_USER = re.compile(r"(?<=://)(?:[^/\s:@'\"]*:(?!\d+(?:[/\s'\",;]|$))[^\s'\"]*|[^/\s'\"]*)@")
"""User name and password: up to the last @ before the path, or of a word whose password contains slashes."""

_QUERY = re.compile(r"(\b[a-zA-Z][\w+.-]*://[^\s'\"?#]*)([?#][^\s'\"]*)")

_VALUE = re.compile(r"(?<=[?&#;])(?!(?:baud|rtscts|datagram)=)([^=&;#]*)=[^&;#]*")
"""Query of a URL, except the settings of links to boards."""


def without_secrets(text: str) -> str:
    """Hide user names, passwords and the values of queries in a URL, or in a sentence with URLs.

    Returns
    -------
    str
        Text with ``***`` in their place; the settings ``baud``, ``rtscts`` and ``datagram`` of links to boards stay.
    """
    printable = _USER.sub("***@", text)
    return _QUERY.sub(lambda match: match[1] + _VALUE.sub(r"\1=***", match[2]), printable)
