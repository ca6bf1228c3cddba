"""How the chaser moves: guidance modes, thrusters and control, manual control, command scripts, keep-out sphere."""
