"""The ray-cast body (Earth or another): its view, its air, and plain ground. No maps of the Earth."""
