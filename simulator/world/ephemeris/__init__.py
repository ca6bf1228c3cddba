"""Where Earth, Moon and Sun are, how they are turned, and what they shade. No spacecraft."""
