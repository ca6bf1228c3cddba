"""Hardware in the loop: host, board and the link between them."""
