"""What can be wrong with what a board is given, each as one sentence saying what, where and what to do."""


class BoardModelError(ValueError):
    """A board model or camera that cannot be used, with the reason."""


class KernelError(BoardModelError):
    """Compiled kernels that were asked for and cannot be had, with the reason."""
