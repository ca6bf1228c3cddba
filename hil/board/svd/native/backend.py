"""One interface to the estimator's inner loops: C where it could be compiled, else the numpy twin.

A numpy function becomes one of two twins by ``@accelerated(native_function)``: it is the reference, runs anywhere, and
stays reachable as ``.reference``. ``TWINS`` lists them all, so that a test can hold each C function against its twin.
"""

from __future__ import annotations

import ctypes
import functools
import os
from dataclasses import dataclass
from typing import Any, Callable, Dict, Optional, Tuple, TypeVar, cast

from flyaround.hil.board.errors import KernelError
from flyaround.hil.board.svd.native.library import choose_library, load_library

# Environment variable that chooses: auto (C where it can be had), numpy, native (C, or refuse to run).
BACKEND_VARIABLE = "FLYAROUND_KERNELS"
BACKENDS = ("auto", "numpy", "native")

Function = TypeVar("Function", bound=Callable[..., Any])


@dataclass(frozen=True)
class Twin:
    """One function in its two forms.

    Parameters
    ----------
    reference : numpy. native : the same with the loaded library before its arguments.
    """

    reference: Callable[..., Any]
    native: Callable[..., Any]


# Each accelerated function by module and name.
TWINS: Dict[str, Twin] = {}


def accelerated(
    native: Callable[..., Any], takes: Optional[Callable[..., bool]] = None
) -> Callable[[Function], Function]:
    """Decorator of a numpy function whose work C does where it is loaded.

    Parameters
    ----------
    native : called with the library and the function's own arguments; it may return ``NotImplemented``.
    takes : whether C takes these arguments; all of them if it is not given.
    """

    def decorate(reference: Function) -> Function:
        @functools.wraps(reference)
        def run(*args: Any, **kwargs: Any) -> Any:  # noqa: ANN401 - whatever the function takes and gives
            library = native_library()
            if library is not None and (takes is None or takes(*args, **kwargs)):
                out = native(library, *args, **kwargs)
                if out is not NotImplemented:
                    return out
            return reference(*args, **kwargs)

        TWINS[f"{reference.__module__}.{reference.__qualname__}"] = Twin(reference, native)
        run.reference = reference  # type: ignore[attr-defined]
        return cast("Function", run)

    return decorate


def native_library() -> Optional[ctypes.CDLL]:
    """The compiled C, None where numpy does its work.

    Raises
    ------
    KernelError
        If ``FLYAROUND_KERNELS`` is none of ``BACKENDS``, or asks for what cannot be had: one sentence.
    """
    return _loaded()[0]


def describe_backend() -> str:
    """``native``, or ``numpy`` with the reason in brackets."""
    library, reason = _loaded()
    return "native" if library is not None else f"numpy ({reason})"


@functools.lru_cache(maxsize=None)
def _loaded() -> Tuple[Optional[ctypes.CDLL], str]:
    """The library or None, and why there is none."""
    choice = os.environ.get(BACKEND_VARIABLE, "") or "auto"
    if choice not in BACKENDS:
        raise KernelError(
            f"{BACKEND_VARIABLE} is {choice!r}: choose one of {', '.join(BACKENDS)}, or leave it unset"
        )
    if choice == "numpy":
        return None, f"{BACKEND_VARIABLE} asks for it"
    try:
        return load_library(choose_library()), ""
    except KernelError as error:
        if choice == "native":
            raise KernelError(f"{BACKEND_VARIABLE} asks for native kernels, but {error}") from error
        return None, str(error)
