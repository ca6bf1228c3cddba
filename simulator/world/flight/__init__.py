"""A propagated flight: put together, its state at any moment, its log, table, recording and messages."""
