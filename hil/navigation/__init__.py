"""Navigation on poses: a filter, guidance on its estimate, the loop that flies both. Draws nothing, knows no board."""
