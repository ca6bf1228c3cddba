"""What travels: packet header and CRC, the messages in payloads, images cut into chunks. No I/O."""
