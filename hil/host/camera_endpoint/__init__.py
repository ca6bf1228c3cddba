"""Simulated camera for machine-vision software: a GVCP/GVSP endpoint in a separate process.

Written from public material (Wireshark's dissectors, Aravis); no compliance with any standard is claimed. ``gvcp`` and
``gvsp`` are about packets alone, ``registers`` about writable settings; ``endpoint`` has the sockets, ``camera``
renders on request of the endpoint. The stream is independent of boards; ``answer_port`` receives the poses of one that
reads it, and ``camera_ledger`` records them.
"""
