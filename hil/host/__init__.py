"""Streams frames to a board, keeps the timing ledger and the truth endpoint.

``run`` drives a run frame by frame; ``server`` holds the link, whose I/O and timestamps live in a process
of their own (``link_process``), because a renderer that draws in software holds the interpreter's lock.
"""
