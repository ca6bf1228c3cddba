"""Errors of the board's input files; each message is one sentence with the problem, the place and the remedy."""


class BoardModelError(ValueError):
    """Unusable board model or camera."""


class KernelError(BoardModelError):
    """Compiled kernels requested but not available."""
