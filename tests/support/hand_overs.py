"""Follow one argument through the calls of the library: which files it enters, and how often."""

import dataclasses
import sys
from functools import partial
from itertools import groupby
from pathlib import Path

import numpy as np

import riemhuman

PACKAGE = str(Path(riemhuman.__file__).parent)
_STARRED = 0x04 | 0x08  # flags of functions that take *args, or **kwargs


def files_entered(call, is_followed):
    """Return the files that an argument is handed on to, in order; an entry for each stay.

    A stay is a run of calls into functions of one file, one of whose arguments is what is followed,
    or holds it. Calls from one line to one function count once, as a reader reads them. What
    threads would run follows in the order in which it is handed to them.
    """
    seen, files = set(), []

    def follow(frame, event, _):
        code = frame.f_code
        if event != "call" or not code.co_filename.startswith(PACKAGE):
            return
        caller = frame.f_back
        while caller is not None and not caller.f_code.co_filename.startswith(PACKAGE):
            caller = caller.f_back
        step = (code, caller and (caller.f_code, caller.f_lineno))
        if step in seen or code.co_name.startswith("<"):
            return
        seen.add(step)
        n_arguments = code.co_argcount + code.co_kwonlyargcount
        n_arguments += (code.co_flags & _STARRED).bit_count()
        arguments = [frame.f_locals.get(name) for name in code.co_varnames[:n_arguments]]
        if _holds(arguments, is_followed):
            files.append(code.co_filename[len(PACKAGE) + 1 :])

    sys.setprofile(follow)
    try:
        call()
    finally:
        sys.setprofile(None)
    return [file for file, _ in groupby(files)]


def _holds(value, is_followed, depth=0):
    """Return whether a value is followed, or a record, list or partial that holds what is."""
    if is_followed(value):
        return True
    if depth > 4 or isinstance(value, (np.ndarray, type)):
        return False
    parts = ()
    if dataclasses.is_dataclass(value):
        parts = vars(value).values()
    elif isinstance(value, partial):
        parts = (*value.args, *value.keywords.values())
    elif isinstance(value, (tuple, list)):
        parts = value[:20]
    return any(_holds(part, is_followed, depth + 1) for part in parts)
