"""Errors of the board's input files. Each message is one sentence: problem, place, remedy."""


class BoardModelError(ValueError):
    """Unusable board model or camera."""


class KernelError(BoardModelError):
    """Compiled kernels are required but not available."""
