"""Transports: the protocol class, and one module per transport. Messages are not parsed here."""
