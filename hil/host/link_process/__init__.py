"""The link in a process of its own: sockets, timestamps, what became of each frame. The renderer never runs here."""
