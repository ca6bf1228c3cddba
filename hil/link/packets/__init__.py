"""Packet header and CRC, messages in payloads, and images cut into chunks. No I/O."""
