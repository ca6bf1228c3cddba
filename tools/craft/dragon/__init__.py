"""Dragon: the crewed craft and the cargo craft of 2010 to 2020."""
