"""Link in a separate process: sockets, timestamps and outcomes of frames. The renderer never runs here."""
