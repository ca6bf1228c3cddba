"""A line to one other side: the contract, and one file a transport. No message is read here."""
