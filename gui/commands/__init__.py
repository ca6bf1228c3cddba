"""Commands of the operator, one file a subject; `all` lists them."""
