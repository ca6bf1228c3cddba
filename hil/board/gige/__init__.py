"""Board on a GigE Vision camera: reads frames through Aravis, estimates poses, and records or returns them.

The code does not distinguish the simulated camera from a real one. The GigE Vision protocol has no channel for poses,
so they are written to a file or sent to the host on a separate connection.
"""
