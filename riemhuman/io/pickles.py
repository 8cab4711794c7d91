"""Pickles of body models, read as data.

A pickle is a program: it can name any function and have it called. Python's unpickler, even one
that is restricted to some names, also sets attributes of what it finds and allocates memory for
sizes that the file merely declares. So these files are read by a small stack machine that knows
only the opcodes of plain data and the names of `riemhuman.io._pickle_allow_list`.
"""

from __future__ import annotations

import codecs
import io
import os
import pickletools
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from riemhuman.errors import FileFormatError
from riemhuman.io._pickle_allow_list import Global
from riemhuman.io._pickled_objects import Budget, Record, plain_value, shortened
from riemhuman.io.files import file_path, read_bytes

# A body model takes some hundreds of opcodes.
_MOST_OPCODES = 50_000
_MOST_BITS = 64
_LATEST_PROTOCOL = 5
_NAMES_SHOWN = 40
# Data are read, decoded to bytes and viewed, so that an honest file needs no more copies than this.
_COPIES = 4
# Selected and widened entries of an honest file take no more bytes than this for each of its own.
_WIDENED = 16

_VALUES = {
    "INT",
    "BININT",
    "BININT1",
    "BININT2",
    "LONG",
    "LONG1",
    "LONG4",
    "FLOAT",
    "BINFLOAT",
    "STRING",
    "BINSTRING",
    "SHORT_BINSTRING",
    "BINBYTES",
    "SHORT_BINBYTES",
    "BINBYTES8",
    "BYTEARRAY8",
    "UNICODE",
    "BINUNICODE",
    "SHORT_BINUNICODE",
    "BINUNICODE8",
}
_CONSTANTS = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False, "EMPTY_TUPLE": ()}
_COLLECTIONS: dict[str, Callable[[list[Any]], Any]]
_COLLECTIONS = {"TUPLE": tuple, "LIST": list, "FROZENSET": tuple}
_TUPLES = {"TUPLE1": 1, "TUPLE2": 2, "TUPLE3": 3}
_BY_CODE = {opcode.code: opcode for opcode in pickletools.opcodes}


def load_pickled_arrays(
    path: str | os.PathLike[str], required: Sequence[str], optional: Sequence[str] = ()
) -> dict[str, Any]:
    """Read the named arrays of a pickled dictionary without running anything in it.

    Parameters
    ----------
    path : path_like
        The file, written by Python 2 or 3 with any protocol.
    required : sequence of str
        Fields that the file must contain.
    optional : sequence of str
        Fields to read if the file contains them. Others are ignored.

    Returns
    -------
    arrays : dict of str to array or scipy.sparse.coo_array
        The fields; chumpy objects are returned as arrays.

    Raises
    ------
    ArgumentTypeError
        If `path` is not a path.
    FileError
        If the file is missing or cannot be read.
    FileFormatError
        If it is not the pickle of a dictionary, lacks a field, or holds anything but plain data,
        arrays, sparse matrices and chumpy arrays; the message names what was refused.
    """
    file = file_path(path)
    content = read_bytes(file)
    try:
        fields = _Machine(content).run()
        if not isinstance(fields, dict):
            raise FileFormatError(f"holds {type(fields).__name__} in place of a dictionary")
        missing = [name for name in required if name not in fields]
        if missing:
            found = sorted(shortened(name) for name in fields)[:_NAMES_SHOWN]
            raise FileFormatError(
                f"lacks the fields {', '.join(missing)}; found {', '.join(found) or 'none'}"
            )
        wanted = [name for name in (*required, *optional) if name in fields]
        budget = Budget(_WIDENED * len(content))
        return {name: _field(fields, name, budget) for name in wanted}
    except FileFormatError as error:
        raise FileFormatError(f"{file} {error}") from error


def _field(fields: dict[Any, Any], name: str, budget: Budget) -> Any:
    try:
        return plain_value(fields[name], budget)
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:
        raise FileFormatError(f"{error}, in its field {name}") from error


class _Machine:
    """The stack and the memory on which the opcodes of a pickle work."""

    def __init__(self, content: bytes) -> None:
        self._content = content
        self._budget = Budget(_COPIES * len(content))
        self._stack: list[Any] = []
        self._below: list[list[Any]] = []
        self._memory: dict[int, Any] = {}

    def run(self) -> Any:
        """Return what the pickle holds."""
        for name, argument, position in _opcodes(self._content):
            if name == "STOP":
                break
            try:
                self._step(name, argument)
            except FileFormatError:
                raise
            except (ArithmeticError, LookupError, TypeError, ValueError) as error:
                raise FileFormatError(
                    f"is a damaged pickle: {name} at byte {position} cannot work on what it finds"
                ) from error
        if len(self._stack) != 1 or self._below:
            raise FileFormatError("is a damaged pickle: it does not end in one object")
        return self._stack[0]

    def _step(self, name: str, argument: Any) -> None:
        stack = self._stack
        if name in _VALUES:
            stack.append(_checked(argument))
        elif name in _CONSTANTS:
            stack.append(_CONSTANTS[name])
        elif name == "PROTO":
            if argument > _LATEST_PROTOCOL:
                raise FileFormatError(f"is a pickle of the unknown protocol {argument}")
        elif name == "FRAME":
            pass
        elif name == "MARK":
            self._below.append(stack)
            self._stack = []
        elif name in ("PUT", "BINPUT", "LONG_BINPUT"):
            self._memory[argument] = stack[-1]
        elif name == "MEMOIZE":
            self._memory[len(self._memory)] = stack[-1]
        elif name in ("GET", "BINGET", "LONG_BINGET"):
            stack.append(self._memory[argument])
        elif name in _TUPLES:
            items = tuple(stack.pop() for _ in range(_TUPLES[name]))
            stack.append(items[::-1])
        elif name in ("TUPLE", "LIST", "DICT", "FROZENSET"):
            marked = self._marked()
            self._stack.append(_pairs(marked) if name == "DICT" else _COLLECTIONS[name](marked))
        elif name in ("EMPTY_LIST", "EMPTY_SET"):
            stack.append([])
        elif name == "EMPTY_DICT":
            stack.append({})
        elif name == "APPEND":
            item = stack.pop()
            _only(stack[-1], list).append(item)
        elif name in ("APPENDS", "ADDITEMS"):
            marked = self._marked()
            _only(self._stack[-1], list).extend(marked)
        elif name == "SETITEM":
            value, key = stack.pop(), stack.pop()
            _only(stack[-1], dict).update(_pairs([key, value]))
        elif name == "SETITEMS":
            marked = self._marked()
            _only(self._stack[-1], dict).update(_pairs(marked))
        elif name == "GLOBAL":
            stack.append(Global(*argument.split(" ", 1)))
        elif name == "STACK_GLOBAL":
            attribute, module = stack.pop(), stack.pop()
            stack.append(Global(_only(module, str), _only(attribute, str)))
        elif name == "REDUCE":
            arguments, function = stack.pop(), stack.pop()
            if not isinstance(function, Global):
                raise FileFormatError(f"calls {type(function).__name__}, which is refused")
            stack.append(function.call(arguments, self._budget))
        elif name == "NEWOBJ":
            arguments, cls = stack.pop(), stack.pop()
            stack.append(_only(cls, Global).new(arguments))
        elif name == "BUILD":
            state = stack.pop()
            if not isinstance(stack[-1], Record):
                raise FileFormatError(
                    f"sets attributes of {type(stack[-1]).__name__}, which is refused"
                )
            stack[-1].build(state, self._budget)
        else:
            raise FileFormatError(
                f"uses the opcode {name}, which is refused: no body model needs it"
            )

    def _marked(self) -> list[Any]:
        marked = self._stack
        self._stack = self._below.pop()
        return marked


def _opcodes(content: bytes) -> Iterator[tuple[str, Any, int]]:
    """Yield the name, the argument and the position of every opcode."""
    stream = io.BytesIO(content)
    for _ in range(_MOST_OPCODES):
        position = stream.tell()
        code = stream.read(1)
        opcode = _BY_CODE.get(code.decode("latin-1"))
        if opcode is None:
            found = f"holds {code!r}" if code else "ends too early"
            raise FileFormatError(f"is not a whole pickle: it {found} at byte {position}")
        try:
            argument: Any = None
            if opcode.name == "STRING":
                # Data of arrays may be here; the reader of pickletools accepts only ASCII.
                text: Any = pickletools.read_stringnl(stream, decode=False)
                with warnings.catch_warnings():
                    # Unknown escapes are malformed; later releases of Python refuse them.
                    warnings.simplefilter("error", DeprecationWarning)
                    argument = codecs.escape_decode(text)[0].decode("latin-1")
            elif opcode.arg is not None:
                argument = opcode.arg.reader(stream)
                if opcode.name == "FRAME" and argument > len(content) - stream.tell():
                    raise ValueError
        except (ArithmeticError, DeprecationWarning, ValueError) as error:
            raise FileFormatError(
                f"is not a whole pickle: the argument of {opcode.name} at byte {position} "
                "is malformed or cut off"
            ) from error
        yield opcode.name, argument, position
        if opcode.name == "STOP":
            return
    raise FileFormatError(f"is a pickle of more than {_MOST_OPCODES} opcodes, which is refused")


def _checked(value: Any) -> Any:
    if isinstance(value, int) and value.bit_length() > _MOST_BITS:
        raise FileFormatError(
            f"holds a whole number of {value.bit_length()} bits, which is refused"
        )
    return value


def _only(value: Any, kind: type) -> Any:
    """Return a value, or raise an error if it is of another type."""
    if not isinstance(value, kind):
        raise TypeError
    return value


def _pairs(items: list[Any]) -> dict[Any, Any]:
    """Return keys and values as a dictionary; keys are text or numbers, so that hashing is safe."""
    keys = items[::2]
    if len(items) % 2 or not all(isinstance(key, (str, bytes, int)) for key in keys):
        raise FileFormatError("holds a dictionary with keys that are neither text nor numbers")
    return dict(zip(keys, items[1::2], strict=True))
