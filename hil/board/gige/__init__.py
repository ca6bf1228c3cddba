"""Board that reads a GigE Vision camera instead of the link: Aravis, frames and recorded poses.

Nothing here knows the simulated camera from a real one. A camera takes no poses, so they go to a file, and on a line of
their own to a host that keeps a ledger.
"""
