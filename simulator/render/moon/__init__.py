"""The Moon: its view, its craters, and the pass that draws it."""
