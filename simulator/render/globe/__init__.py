"""The body that is ray-cast, whichever it is: its view, its air, and plain ground. No maps of the Earth."""
