"""Packets, framing, transports. Imports nothing of the project; standard library and numpy only.

A reader who follows one frame opens, in order: ``packets`` (header and CRC, what a payload says, a frame as chunks),
``framing`` (bytes on a line), ``transports`` (TCP, serial, in-process), ``clock`` (offset exchange) and ``session``
(the handshake). The layout is documented byte by byte in ``docs/hil_protocol.md``.
"""
