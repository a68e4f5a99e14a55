"""Odd values to try as arguments, and a check of the response to them."""

import math
import traceback
from pathlib import Path

import numpy as np

# Values of ODD that are no numbers, and those that are no whole numbers.
NO_NUMBERS = {"bytes", "nan", "true", "complex", "empty", "ragged", "no number in it", "three numbers", "empty array"}
NO_NUMBERS |= {"square", "dictionary", "object", "function"}
NO_COUNTS = NO_NUMBERS | {"infinite", "minute"}

OURS = tuple(str(Path(__file__).parents[1] / package) for package in ("optics", "sim", "evolve"))
ODD = {
    "none": None,
    "word": "auto",
    "bytes": b"x",
    "nan": math.nan,
    "infinite": math.inf,
    "negative": -1,
    "zero": 0,
    "minute": 1e-30,
    "huge": 10**400,
    "true": True,
    "complex": 1j,
    "empty": [],
    "ragged": [[1, 2], [3]],
    "no number in it": [None],
    "three numbers": (1, 2, 3),
    "array without axes": np.array(1.0),
    "empty array": np.zeros(0),
    "square": np.zeros((2, 2)),
    "NumPy's number": np.float32(2),
    "dictionary": {},
    "object": object(),
    "function": abs,
}


def complaint(call, arguments, must_fail=False):
    """Return None if the call succeeds or raises a one-line error of this project; otherwise describe the problem.

    must_fail: True if success is a problem, too
    """
    try:
        call(**arguments)
    except (ValueError, OSError) as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        if not str(error) or "\n" in str(error):
            return f"not one line: {error}"
        # An error raised by compiled code has no source line of its own: it seems to come from the line of the call.
        ours = last.filename.startswith(OURS) and last.line.startswith("raise ")
        return None if ours or isinstance(error, OSError) else f"{error} ({last.filename}:{last.lineno})"
    except Exception as error:
        return repr(error)
    return "accepted" if must_fail else None


def complaints(call, valid):
    """Return the complaints about calls in which an odd value replaces one argument; the valid call must succeed.

    A number must not be replaced by something else, nor a whole number by a fraction.
    """
    call(**valid)
    found = {}
    for argument, usual in valid.items():
        wrong = NO_COUNTS if type(usual) is int else NO_NUMBERS if type(usual) is float else ()
        for what, odd in ODD.items():
            if (said := complaint(call, valid | {argument: odd}, what in wrong)) is not None:
                found[argument, what] = said
    return found


def masked(value, rng):
    """Return the same numbers with at least one of them masked.

    The result is a row of three for None, and None for values of other kinds.
    """
    try:
        given = np.asarray([1.0, 2.0, 3.0] if value is None else value)
    except (TypeError, ValueError):
        return None
    if given.dtype.kind not in "iufc" or not given.size:
        return None
    hidden = np.array(rng.random(given.shape) < 0.3)
    hidden.flat[rng.integers(given.size)] = True
    return np.ma.masked_array(given, hidden)


def masked_complaints(call, valid, rng):
    """Return complaints about arguments that accept masked elements, also within lists, or refuse them incorrectly."""
    found = {}
    for argument, value in valid.items():
        if (array := masked(value, rng)) is None:
            continue
        for odd in [array, *([list(array)] if array.ndim == 1 else [])]:
            try:
                call(**valid | {argument: odd})
                found[argument, type(odd).__name__] = "accepted"
            except Exception:
                if (said := complaint(call, valid | {argument: odd})) is not None:
                    found[argument, type(odd).__name__] = said
    return found
