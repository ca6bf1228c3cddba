"""Lines to one other side: the protocol, and one module per transport. No message is read here."""
