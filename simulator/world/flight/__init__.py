"""A propagated flight: construction, states, log, table, recording and messages."""
