"""Packets out of a stream of bytes: length prefix for TCP, COBS for serial lines. No I/O."""
