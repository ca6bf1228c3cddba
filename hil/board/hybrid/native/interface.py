"""ctypes types of the library's functions and structures, parsed from kernels.h, which alone declares them."""

from __future__ import annotations

import ctypes
import hashlib
import pkgutil
import re
from typing import Any, Callable, Dict, Iterator, List, Optional, Tuple, Type

import numpy as np

Array = np.ndarray

_header = pkgutil.get_data("flyaround.hil.board.hybrid.native", "kernels.h")
if _header is None:
    raise ImportError("flyaround.hil.board.hybrid.native has no kernels.h; install the package again")
HEADER: bytes = _header

SCALARS: Dict[str, Any] = {
    "void": None,
    "int": ctypes.c_int,
    "int64_t": ctypes.c_int64,
    "float": ctypes.c_float,
    "double": ctypes.c_double,
}

# Array dtypes allowed for a pointer type; a void pointer takes any array, or an address.
ELEMENTS = {
    "uint8_t": ("uint8", "bool"),
    "uint16_t": ("uint16",),
    "int16_t": ("int16",),
    "int32_t": ("int32",),
    "int64_t": ("int64",),
    "float": ("float32",),
    "double": ("float64",),
}

# Built once, because comparing a dtype with a name builds one each time.
DTYPES = {name: np.dtype(name) for names in ELEMENTS.values() for name in names}

_first_element: Callable[[Any], ctypes.c_char] = ctypes.c_char.from_buffer


def contiguous(a: Array, dtype_name: str, shape: Optional[Tuple[int, ...]] = None) -> Array:
    """Return the array C-contiguous and of a dtype, without a copy if possible.

    Parameters
    ----------
    a : array
        Argument of a function of the library, before conversion.
    dtype_name : str
        Name of the dtype, one of those in `ELEMENTS`.
    shape : tuple of int, optional
        Shape that the library assumes, if it does not follow from other arguments.

    Raises
    ------
    ValueError
        If the shape differs, which would cause out-of-bounds reads.
    """
    if shape is not None and a.shape != shape:
        raise ValueError(f"the library takes {dtype_name} {shape}, not {a.shape}")
    if a.dtype == DTYPES[dtype_name] and a.flags.c_contiguous:
        return a
    return np.ascontiguousarray(a, dtype=dtype_name)


def address(a: Array) -> int:
    """Return the address of an array's first element; the caller keeps the array alive."""
    try:
        # faster than ``__array_interface__``
        return ctypes.addressof(_first_element(a))
    except (TypeError, ValueError):
        # read-only or empty array
        return int(a.__array_interface__["data"][0])


class ArrayPointer:
    """Type of a pointer argument: a C-contiguous array of its dtype, or None for NULL."""

    dtypes: Tuple[Any, ...] = ()

    @classmethod
    def from_param(cls, a: Optional[Array]) -> ctypes.c_void_p:
        """Return the pointer for ctypes.

        Raises
        ------
        TypeError
            If the array has another dtype or layout, which would cause out-of-bounds reads.
        """
        if a is None:
            return ctypes.c_void_p()
        if not isinstance(a, np.ndarray) or a.dtype not in cls.dtypes or not a.flags.c_contiguous:
            given = f"{a.dtype} {a.shape}" if isinstance(a, np.ndarray) else type(a).__name__
            raise TypeError(f"takes a contiguous array of {cls.__name__}, not {given}")
        return ctypes.c_void_p(address(a))


class Structure(ctypes.Structure):
    """Structure of the header, constructed from all fields by name; it keeps the arrays that it points to alive.

    Raises
    ------
    TypeError
        If a field is missing, or is not in the header.
    """

    pointers: Dict[str, Any] = {}  # noqa: RUF012 - filled where a structure is declared

    def __init__(self, **values: Any) -> None:  # noqa: ANN401 - numbers and arrays
        names = [field[0] for field in self._fields_]
        if set(values) != set(names):
            raise TypeError(f"{type(self).__name__} takes {', '.join(names)}, not {', '.join(values)}")
        self.values = values
        super().__init__(**{**values, **{k: t.from_param(values[k]) for k, t in self.pointers.items()}})

    def __reduce__(self) -> Tuple[Any, ...]:
        # pointers are not valid in another process: pickle the values instead
        return make_structure, (type(self).__name__, self.values)


def _array_pointer(element: str) -> Type[ArrayPointer]:
    dtypes = tuple(DTYPES[name] for name in ELEMENTS[element])
    return type(str(dtypes[0]), (ArrayPointer,), {"dtypes": dtypes})


class AnyPointer:
    """Type of a void pointer: an array of any dtype and layout, or an address."""

    @staticmethod
    def from_param(a: Any) -> ctypes.c_void_p:  # noqa: ANN401 - see the class
        """Return the pointer for ctypes.

        Raises
        ------
        TypeError
            If it is neither.
        """
        return ctypes.c_void_p(address(a) if isinstance(a, np.ndarray) else int(a))


POINTERS: Dict[str, Any] = {
    **{element: _array_pointer(element) for element in ELEMENTS},
    "void": AnyPointer,
}


def _declarations(text: str) -> Iterator[Tuple[str, bool, str]]:
    """Yield type, pointer flag and name of the fields or arguments declared in plain C."""
    for declaration in filter(None, (part.strip() for part in text.split(";"))):
        match = re.match(r"(?:const )?((?:struct )?\w+) (.+)", declaration, re.DOTALL)
        if match is None:
            raise ValueError(f"kernels.h: cannot read {declaration!r}")
        for name in match[2].split(","):
            yield match[1], name.strip().startswith("*"), name.strip(" *\n")


def _field(c_type: str, *, pointer: bool) -> Any:  # noqa: ANN401 - a ctypes type
    return ctypes.c_void_p if pointer else SCALARS[c_type]


def _structures(text: str) -> Dict[str, Type[Structure]]:
    out: Dict[str, Type[Structure]] = {}
    for name, body in re.findall(r"^struct (\w+) \{(.*?)^\};", text, re.DOTALL | re.MULTILINE):
        fields = list(_declarations(body))
        out[name] = type(
            name,
            (Structure,),
            {
                "_fields_": [(field, _field(c_type, pointer=star)) for c_type, star, field in fields],
                "pointers": {field: POINTERS[c_type] for c_type, star, field in fields if star},
            },
        )
    return out


def _argument(c_type: str, *, pointer: bool) -> Any:  # noqa: ANN401 - a ctypes type
    if c_type.startswith("struct "):
        return ctypes.POINTER(STRUCTURES[c_type[7:]])
    if pointer:
        return POINTERS[c_type]
    return SCALARS[c_type]


def _functions(text: str) -> Dict[str, Tuple[Any, List[Any]]]:
    out: Dict[str, Tuple[Any, List[Any]]] = {}
    declared = re.findall(r"^KERNEL (?:const )?(\w+) (\*?)(\w+)\((.*?)\);", text, re.DOTALL | re.MULTILINE)
    if len(declared) != len(re.findall(r"^KERNEL ", text, re.MULTILINE)):
        raise ValueError("kernels.h: cannot read the declaration of a function")
    for c_type, star, name, arguments in declared:
        if star and c_type != "char":
            raise ValueError(f"kernels.h: {name} returns a pointer to {c_type}; only char is read")
        text_of_arguments = "" if arguments == "void" else arguments.replace(",", ";")
        types = [
            _argument(element, pointer=pointer) for element, pointer, _ in _declarations(text_of_arguments)
        ]
        out[name] = ctypes.c_char_p if star else SCALARS[c_type], types
    return out


_TEXT = re.sub(r"/\*.*?\*/", "", HEADER.decode(), flags=re.DOTALL)

STRUCTURES = _structures(_TEXT)
"""The header's structures by name."""

FUNCTIONS = _functions(_TEXT)
"""Result type and argument types of the header's functions, by name."""


def make_structure(name: str, values: Dict[str, Any]) -> Structure:
    """Return a structure of the header by name."""
    return STRUCTURES[name](**values)


def checksum() -> str:
    """Return the checksum of the header, which the compiled library must report."""
    return hashlib.sha256(HEADER.replace(b"\r\n", b"\n")).hexdigest()


def layout() -> List[int]:
    """Return the size of each structure and the offsets of its fields, like ``fly_layout``."""
    out: List[int] = []
    for structure in STRUCTURES.values():
        out.append(ctypes.sizeof(structure))
        out.extend(getattr(structure, field[0]).offset for field in structure._fields_)
    return out
