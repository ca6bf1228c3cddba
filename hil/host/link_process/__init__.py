"""Link in a separate process: sockets, time stamps and outcomes of frames. The renderer never runs here."""
