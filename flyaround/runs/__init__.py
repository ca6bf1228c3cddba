"""Runs: what a command is asked for as a typed document, read from a TOML file or from the command line.

Here live the documents, their reader and writer, and the options that are made of their fields; no command does its
work here.
"""
