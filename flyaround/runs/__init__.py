"""Runs: the options of a command as a typed document, from a TOML file or the command line.

Here live the documents, their reader and writer, and the options that are made of their fields; no command does its
work here.
"""
