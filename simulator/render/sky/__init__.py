"""Stars and Sun: catalogue, colours, and the passes that draw them."""
