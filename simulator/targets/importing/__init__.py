"""A user's mesh made into a target: read, check, repair, propose labels, install. No GL, no built-in craft."""
