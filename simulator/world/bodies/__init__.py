"""The built-in bodies, one object a file, found by name (`world.ephemeris.body.body_named`). No drawing, no forces."""
