"""Packets, framing and transports. Imports nothing else of the project; standard library and NumPy only.

To follow one frame, read in order: ``packets`` (header and CRC, payloads, a frame as chunks), ``framing`` (bytes on a
line), ``transports`` (TCP, serial), ``clock`` (offset estimation) and ``session`` (handshake). The layout is documented
byte by byte in ``docs/hil_protocol.md``.
"""
