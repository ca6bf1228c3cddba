"""Motion of the chaser: guidance modes, thrusters and control, manual control, command scripts, keep-out sphere."""
