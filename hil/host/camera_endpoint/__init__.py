"""Simulated camera for machine-vision software: a GVCP/GVSP endpoint in a separate process.

Written from public material (Wireshark's dissectors, Aravis); no compliance with any standard is claimed. ``gvcp`` and
``gvsp`` define packets, ``registers`` the writable settings; ``endpoint`` owns the sockets, ``simulated_camera``
renders on request of the endpoint. The stream does not depend on boards: ``answer_port`` receives the poses of a board
that reads it, and ``camera_ledger`` records them.
"""
