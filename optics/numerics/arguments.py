"""Checks of arguments. Each error names the argument, what is valid and, usually, the value."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from optics.numerics.autodiff import carries_derivative, is_differentiable, number, plain
from optics.numerics.number_types import as_array, full_precision, is_boolean, readable

__all__ = [
    "close_match",
    "complexes",
    "did_you_mean",
    "finite",
    "flag",
    "in_range",
    "is_sized",
    "items",
    "of_kind",
    "one_of",
    "pair",
    "plain_reals",
    "point_2d",
    "positive",
    "radiance_cube",
    "reals",
    "shape_2d",
    "shown",
    "vacuum_wavelength",
    "vacuum_wavelengths",
    "wavelength_row",
    "whole",
    "without_derivative",
]

# Limits of positive numbers. Their squares, and ratios of the squares, stay within the range of double precision.
SMALLEST, LARGEST = 1e-15, 1e15
LONGEST_WAVE = 1.0  # [m]; larger values are probably wavelengths in nanometres
UNIT = " (550 nm is 550e-9)"
LINE = 200  # most characters of a value in a message


def shown(value: Any) -> str:
    """Return `value`, or each entry of a tuple or list, as Python code; by type and shape if it exceeds one line.

    NumPy numbers are shown as Python numbers, because the package colour-science changes NumPy's print options.
    """
    if isinstance(value, np.generic):
        return repr(value.item())
    if isinstance(value, (tuple, list)):
        ends = "()" if isinstance(value, tuple) else "[]"
        return f"{ends[0]}{', '.join(map(shown, value))}{',' if ends == '()' and len(value) == 1 else ''}{ends[1]}"
    text = repr(value)
    if len(text) <= LINE and "\n" not in text:
        return text
    shape = getattr(value, "shape", None)
    return type(value).__name__ if shape is None else f"{type(value).__name__} of shape {tuple(shape)}"


def finite(name: str, value: float, *, carried: bool = False) -> float:
    """Return `value` as a float; ValueError about `name` unless it is a finite number.

    carried: True if `value` may carry a derivative, which is otherwise refused.
    """
    number = _number(name, value, carried)
    if not math.isfinite(number):
        raise ValueError(f"{name} = {shown(value)}: must be finite")
    return number


def flag(name: str, value: Any) -> bool:
    """Return `value` as a bool. Raise a ValueError about the argument `name` if `value` is neither True nor False."""
    if not is_boolean(value):
        raise ValueError(f"{name} = {shown(value)}: must be True or False")
    return bool(value)


def positive(
    name: str, value: float, unit: str = "m", *, infinite: bool = False, carried: bool = False, most: float = LARGEST
) -> float:
    """Return `value` as a float, or raise a ValueError about the argument `name` unless 1e-15 <= value <= most.

    The default limits keep squares, and ratios of squares, within the range of double precision.

    unit: unit of `value`, for the message. infinite: True if infinity is allowed. carried: see `finite`.
    """
    number = _number(name, value, carried)
    if infinite and number == math.inf:
        return number
    if not SMALLEST <= number <= most:
        size = f" (at least {SMALLEST:g})" if 0 < number < SMALLEST else ""
        upper = ", or infinite" if infinite else f" and at most {most:g}"
        raise ValueError(f"{name} = {shown(value)}: must be greater than 0{size}{upper}, in {unit}")
    return number


def without_derivative(name: str, value: Any) -> Any:
    """Return `value`, or raise a ValueError about the argument `name` if `value` or an entry carries a derivative.

    The derivative would be lost. The functions of this module that check numbers call this one. Only `pair`,
    `plain_reals`, and functions called with carried=True do not, because they accept derivatives.
    """
    if type(value) is float:
        return value  # fast path: planning calls this thousands of times
    if isinstance(value, (tuple, list)):
        for entry in value:
            without_derivative(name, entry)
    elif isinstance(value, np.ma.MaskedArray):
        readable(name, value)
    elif carries_derivative(value):
        raise ValueError(f"{name} requires a derivative, but none is propagated through it: pass a plain number")
    return value


def vacuum_wavelength(value: Any) -> float:
    """Return `value` [m] as a float; ValueError outside [1e-15, 1], for example if a user gives 550 (nanometres)."""
    wavelength = _number("wavelength", value)
    if not SMALLEST <= wavelength <= LONGEST_WAVE:
        raise ValueError(
            f"wavelength = {shown(value)}: must be greater than 0 and at most {LONGEST_WAVE:g}, in m{UNIT}"
        )
    return wavelength


def vacuum_wavelengths(values: Any) -> np.ndarray:
    """Return `values` [m] as a float64 array of any shape; ValueError if one of them is outside [1e-15, 1]."""
    wavelengths = reals("wavelengths", values)
    for end in (wavelengths.min(), wavelengths.max()) if wavelengths.size else ():
        vacuum_wavelength(end)
    return wavelengths


def wavelength_row(values: Any) -> np.ndarray:
    """Return one or several vacuum wavelengths [m] as a float64 array (wavelength,), or raise a ValueError."""
    row = np.atleast_1d(vacuum_wavelengths(values))
    if row.size == 0:
        raise ValueError("wavelengths is empty: must hold at least one wavelength [m]")
    if row.ndim > 1:
        raise ValueError(f"wavelengths has shape {row.shape}: must be one wavelength [m], or a row of them")
    return row


def in_range(name: str, value: float, low: float, high: float, *, carried: bool = False) -> float:
    """Return `value` as a float; ValueError about `name` unless low <= value <= high. carried: see `finite`."""
    number = _number(name, value, carried)
    if not low <= number <= high:
        raise ValueError(f"{name} = {shown(value)}: must lie in [{low:g}, {high:g}]")
    return number


def shape_2d(name: str, value: Any) -> tuple[int, int]:
    """Return (height, width) as ints; ValueError about `name` unless both are whole numbers of at least 1."""
    without_derivative(name, value)
    try:
        height, width = (int(n) for n in value)
        whole = all(bool(n == int(n)) and not is_boolean(n) for n in value)
    except (TypeError, ValueError, OverflowError):
        height = width = 0
        whole = False
    if not whole or height < 1 or width < 1:
        raise ValueError(f"{name} = {shown(value)}: must be two whole numbers (height, width), each at least 1")
    return height, width


def one_of(name: str, value: Any, options: Iterable[str]) -> str:
    """Return `value` if it is one of the options; else raise a ValueError about `name`, which may suggest an option."""
    known = tuple(options)
    if not isinstance(value, str) or value not in known:
        raise ValueError(
            f"{name} = {shown(value)}: must be one of {', '.join(map(repr, known))}{did_you_mean(value, known)}"
        )
    return str(value)


def did_you_mean(word: Any, known: Iterable[str], cutoff: float = 0.5) -> str:
    """Return "; did you mean 'this'?" with the most similar known word, ignoring case, or an empty string."""
    match = close_match(str(word), known, cutoff)
    return f"; did you mean {match!r}?" if match else ""


def close_match(word: str, known: Iterable[str], cutoff: float = 0.5) -> str | None:
    """Return the most similar known word, ignoring case; None if difflib's ratio is below `cutoff` for all words."""
    import difflib  # imported here, because only error messages need it

    plain = {option.lower(): option for option in known}
    near = difflib.get_close_matches(word.lower(), plain, n=1, cutoff=cutoff)
    return plain[near[0]] if near else None


def point_2d(name: str, value: Any, what: str = "lengths (x, y) [m]") -> tuple[float, float]:
    """Return `value`, a pair (x, y), as floats. Raise a ValueError unless both are numbers within ±1e15."""
    x, y = pair(name, without_derivative(name, value), what)
    return in_range(name, x, -LARGEST, LARGEST), in_range(name, y, -LARGEST, LARGEST)


def pair(name: str, value: Any, what: str) -> tuple[Any, Any]:
    """Return both entries of `value`, which may carry derivatives. Raise a ValueError unless there are exactly two.

    what: description of the two entries for the message, such as "lengths (x, y) [m]".
    """
    try:
        x, y = value
    except (TypeError, ValueError):
        raise ValueError(f"{name} = {shown(value)}: must be two {what}") from None
    return x, y


def reals(name: str, values: Any) -> np.ndarray:
    """Return `values` as a float64 array; ValueError about `name` unless they are real numbers without derivatives."""
    given = as_array(name, without_derivative(name, values))
    if given.dtype.kind not in "biuf" or is_boolean(values):
        kind = "complex ones" if given.dtype.kind == "c" else shown(values)
        raise ValueError(f"{name}: must be real numbers, not {kind}")
    return given.astype(np.float64)


def plain_reals(name: str, values: Any) -> np.ndarray:
    """Return `values` as a float64 array, like `reals`, but accept values with derivatives and drop the derivatives."""
    return plain(full_precision(name, values)) if is_differentiable(values) else reals(name, values)


def complexes(name: str, values: Any) -> np.ndarray:
    """Return `values` as an array; ValueError about `name` if one of them is not a number or carries a derivative."""
    given = as_array(name, without_derivative(name, values))
    if given.dtype.kind not in "biufc":
        raise ValueError(f"{name}: must be numbers, not {shown(values)}")
    return given


def radiance_cube(value: Any, bands: int, least: tuple[int, int]) -> np.ndarray:
    """Return `value` as a float32 array (band, Y, X).

    Raises:
        ValueError: the shape is not (`bands`, Y, X), Y or X is below `least`, or a value is not a finite real number.
    """
    radiance = reals("radiance", value).astype(np.float32)
    fits = radiance.ndim == 3 and radiance.shape[0] == bands
    if not fits or any(n < m for n, m in zip(radiance.shape[1:], least, strict=True)):
        raise ValueError(
            f"radiance has shape {radiance.shape}: must be (band, Y, X) with {bands} bands "
            f"and at least {least[0]} x {least[1]} cells"
        )
    if not np.isfinite(radiance).all():
        raise ValueError("radiance holds NaN or infinity: must be finite")
    return radiance


def is_sized(value: Any) -> bool:
    """Return whether `len(value)` works. Arrays of zero dimensions have `__len__`, but it fails."""
    try:
        len(value)
    except TypeError:
        return False
    return True


def items(name: str, values: Any, kind: type, example: str) -> tuple[Any, ...]:
    """Return `values` as a tuple. Raise a ValueError that shows `example` unless all are instances of `kind`."""
    try:
        found = tuple(values)
    except TypeError:
        raise ValueError(f"{name} = {shown(values)}: must be several, such as ({example},)") from None
    for place, one in enumerate(found):
        of_kind(f"{name}[{place}]", one, kind, example)
    return found


def whole(name: str, value: Any, low: int, high: int) -> int:
    """Return `value` as an int; ValueError about `name` unless it is a whole number in [low, high]."""
    without_derivative(name, value)
    try:
        fits = not is_boolean(value) and int(value) == value and low <= int(value) <= high
    except (TypeError, ValueError, OverflowError):
        fits = False
    if not fits:
        raise ValueError(f"{name} = {shown(value)}: must be a whole number in [{low}, {high}]")
    return int(value)


def of_kind(name: str, value: Any, kind: type, example: str) -> Any:
    """Return `value`. Raise a ValueError that shows `example` unless `value` is an instance of `kind`."""
    if not isinstance(value, kind):
        raise ValueError(f"{name} = {shown(value)}: must be a kind of {kind.__name__}, such as {example}")
    return value


def _number(name: str, value: Any, carried: bool = False) -> float:
    if type(value) is float:
        return value  # fast path, as in `without_derivative`
    if not carried:
        without_derivative(name, value)
    value = full_precision(name, value)
    try:
        if isinstance(value, (str, bytes, bool, np.bool_)):
            raise TypeError
        return number(value)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} = {shown(value)}: must be a number") from None
