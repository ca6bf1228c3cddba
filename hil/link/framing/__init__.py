"""Packets from a byte stream: length prefix for TCP, COBS for serial lines. No I/O."""
