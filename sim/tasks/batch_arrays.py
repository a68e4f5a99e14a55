"""Checks of the arrays that the methods of a batch task return.

An error message names the method, and either the wrong shape or the world that has the wrong value.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from optics.numerics.arguments import shown
from optics.numerics.number_types import all_finite, readable
from sim.tasks.outcome import Outcome, RewardTerms

__all__ = ["columns", "mapping", "not_finite", "require_outcome", "require_worlds", "rows"]


def rows(where: str, returned: Any, n: int, kind: type) -> np.ndarray:
    """Return the array `returned` if it has one number for each world, (n,).

    where: source of the array, for the error message
    kind: type to which the entries are converted

    Raises:
        ValueError: the array has another shape, or its entries are not numbers.
    """
    array = _array(where, returned, kind)
    if array.shape != (n,):
        raise ValueError(f"{where} has shape {array.shape}: must be ({n},), one entry for each world")
    return array


def columns(where: str, returned: Any, n: int) -> np.ndarray:
    """Return the array `returned` as float32 if it has a row of k numbers for each world, (n, k).

    Raises:
        ValueError: the array has another shape, or its entries are not finite numbers.
    """
    array = _array(where, returned, np.float32)
    if array.ndim != 2 or len(array) != n:
        raise ValueError(f"{where} has shape {array.shape}: must be ({n}, k), one row for each world")
    if not all_finite(array):
        world = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise ValueError(f"{where} is {array[world].tolist()} in world {world}: must be finite")
    return array


def mapping(where: str, returned: Any, right: str = "arrays by name, such as {'progress': (n,)}") -> Mapping[Any, Any]:
    """Return the object `returned` if it is a mapping. Its keys and values are not checked.

    right: description of a valid object, for the error message

    Raises:
        ValueError: it is not a mapping.
    """
    if not isinstance(returned, Mapping):
        raise ValueError(f"{where} returned {shown(returned)}: must be {right}")
    return returned


def not_finite(where: str, terms: Mapping[str, np.ndarray]) -> dict[int, str]:
    """Return an error message for each world in which a term of the reward is not finite, by the world's index.

    where: beginning of the messages
    terms: terms of the reward by name, (n,) each
    """
    found: dict[int, str] = {}
    for name, term in terms.items():
        for world in np.flatnonzero(~np.isfinite(term)).tolist():
            found.setdefault(world, f"{where}: {name!r} is {term[world]}: must be a finite number")
    return found


def require_outcome(outcome: Outcome, n: int, learners: int) -> None:
    """Check that the arrays of an outcome fit the number of worlds `n` and the number of learning agents.

    Raises:
        ValueError: `outcome` is not an Outcome, an array has another shape or masked elements, a term of the reward is
            not finite, or `outcome` names worlds that do not exist.
    """
    if not isinstance(outcome, Outcome) or not isinstance(outcome.terms, RewardTerms):
        raise ValueError(f"judge returned {shown(outcome)}: must be a sim.Outcome, whose terms are sim.RewardTerms")
    terms, size = outcome.terms.terms, n * learners
    for name, array, shape in (
        ("terms", terms, (len(outcome.terms.names), size)),
        ("terminated", outcome.terminated, (size,)),
        ("success", outcome.success, (size,)),
        ("over", outcome.over, (n,)),
    ):
        if type(array) is not np.ndarray:  # the usual type is readable
            readable(f"judge: {name}", array)
        if array is None and name == "over":
            continue
        if getattr(array, "shape", None) != shape:
            found = f"has shape {array.shape}" if isinstance(array, np.ndarray) else f"is {shown(array)}"
            raise ValueError(f"judge: {name} {found}: must be an array {shape}, one entry for each row")
    if not all_finite(terms):
        place, row = (int(i) for i in np.argwhere(~np.isfinite(terms))[0])
        value = terms[place, row]
        raise ValueError(
            f"judge: the term {outcome.terms.names[place]!r} is {value} in world {row % n}: must be finite"
        )
    if np.size(outcome.changed):  # rarely
        require_worlds("judge: changed", outcome.changed, n)
    if outcome.failure:
        require_worlds("judge: failure", outcome.failure, n)


def require_worlds(where: str, named: Iterable[Any], n: int) -> None:
    """Check that `named` consists of indices of worlds, below `n`; the error message begins with `where`."""
    for world in named:
        if not isinstance(world, int | np.integer) or not 0 <= world < n:
            raise ValueError(f"{where} names world {shown(world)}: must be within 0 and {n - 1}")


def _array(where: str, returned: Any, kind: Any) -> np.ndarray:
    returned = readable(where, returned)
    try:
        given = np.asarray(returned)
        if given.dtype.kind in "biufO":  # NumPy would also convert text, such as "1.5", and drop imaginary parts
            return given.astype(kind)
    except (TypeError, ValueError, OverflowError):
        pass
    raise ValueError(f"{where} returned {shown(returned)}: must be an array of numbers")
