"""Host side: streams frames to a board and keeps the ledger. No pose is estimated here.

``run`` drives a run frame by frame. ``link_process`` runs the link and its time stamps in a separate process, because a
software renderer holds the interpreter's lock. ``ledger`` holds the records, and ``report`` presents them.
"""
