"""Packets, framing, transports. Imports nothing of the project; standard library and numpy only."""
