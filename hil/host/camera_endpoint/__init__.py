"""Simulated camera for machine-vision software: a GVCP/GVSP endpoint in a separate process.

Written from public material (Wireshark's dissectors, Aravis); no compliance with any standard is claimed. ``gvcp`` and
``gvsp`` know packets alone, ``registers`` what the camera can be told, ``endpoint`` has the sockets, ``camera`` draws
what the endpoint asks for. The stream knows no boards; ``answer_port`` takes the poses of one that reads it, and
``camera_ledger`` keeps them.
"""
