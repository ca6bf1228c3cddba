"""Import of a user's mesh as a target: read, check, repair, propose labels, install. No GL, no built-in craft."""
