"""The flight an operator watches and steers; no window, no GL."""
