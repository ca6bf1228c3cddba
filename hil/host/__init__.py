"""Host side: streams frames to a board and keeps the ledger. No pose is estimated here.

``run`` drives a run frame by frame; ``link_process`` has the line and its timestamps in a process of its own, because
a renderer that draws in software holds the interpreter's lock; ``ledger`` is what remains, ``report`` shows it.
"""
