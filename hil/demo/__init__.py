"""The demo: capture, check, close the loop with a board process, and one page of it all."""
