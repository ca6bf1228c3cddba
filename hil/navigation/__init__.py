"""Navigation on poses: filter, guidance on its estimate, and the loop that flies both. Independent of any board."""
