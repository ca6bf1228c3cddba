"""The simulated camera as machine-vision software sees it: a GVCP/GVSP endpoint in a process of its own.

Written from public material (Wireshark's dissectors, Aravis); no compliance with any standard is claimed. ``gvcp`` and
``gvsp`` know packets alone, ``registers`` what the camera can be told, ``endpoint`` has the sockets, ``camera`` draws
what the endpoint asks for. The stream knows no boards; ``answer_port`` takes the poses of one that reads it, and
``camera_ledger`` keeps them.
"""
