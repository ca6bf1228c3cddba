"""Runs: the options of a command as a typed document, from a TOML file or the command line.

Contains the documents, their reader and writer, and the options derived from their fields; the commands are in ``cli``.
"""
