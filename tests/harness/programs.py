"""Programs that a test runs to their end."""

import subprocess


def completed(*words, check=False, timeout=280, **options):
    """The completed program of some words; what it printed is text."""
    command = [str(word) for word in words]
    return subprocess.run(command, capture_output=True, text=True, check=check, timeout=timeout, **options)
