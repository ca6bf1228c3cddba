"""What an operator can do, a file a subject; `all` lists them."""
