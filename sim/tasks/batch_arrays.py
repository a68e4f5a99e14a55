"""Checks of arrays that the methods of a batch task return. Messages name the method, the shape and the world."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from sim.tasks.outcome import Outcome

__all__ = ["columns", "mapping", "not_finite", "require_outcome", "rows"]


def rows(where: str, returned: Any, n: int, kind: type) -> np.ndarray:
    """Return one number for each world, (n,).

    where: source of the array, for the message

    Raises:
        ValueError: another shape, or not numbers.
    """
    array = _array(where, returned, kind)
    if array.shape != (n,):
        raise ValueError(f"{where} has shape {array.shape}: must be ({n},), one entry for each world")
    return array


def columns(where: str, returned: Any, n: int) -> np.ndarray:
    """Return several numbers for each world, (n, k) float32.

    Raises:
        ValueError: another shape, not numbers, or numbers that are not finite.
    """
    array = _array(where, returned, np.float32)
    if array.ndim != 2 or len(array) != n:
        raise ValueError(f"{where} has shape {array.shape}: must be ({n}, k), one row for each world")
    if not np.isfinite(array).all():
        world = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise ValueError(f"{where} is {array[world].tolist()} in world {world}: must be finite")
    return array


def mapping(where: str, returned: Any) -> Mapping[str, Any]:
    """Return arrays by name.

    Raises:
        ValueError: not a mapping.
    """
    if not isinstance(returned, Mapping):
        raise ValueError(f"{where} returned {returned!r:.80}: must be arrays by name, such as {{'progress': (n,)}}")
    return returned


def not_finite(where: str, terms: Mapping[str, np.ndarray]) -> dict[int, str]:
    """Return the worlds in which a term is not finite, with the reason."""
    found: dict[int, str] = {}
    for name, term in terms.items():
        for world in np.flatnonzero(~np.isfinite(term)).tolist():
            found.setdefault(world, f"{where}: {name!r} is {term[world]}: must be a finite number")
    return found


def require_outcome(outcome: Outcome, n: int, learners: int) -> None:
    """Check the arrays of an outcome against the number of worlds.

    Raises:
        ValueError: another shape, a reward that is not finite, or worlds that do not exist.
    """
    size = n * learners
    shapes = outcome.terms.terms.shape[1:], outcome.terminated.shape, outcome.success.shape
    for name, shape in zip(("terms", "terminated", "success"), shapes, strict=True):
        if shape != (size,):
            raise ValueError(f"judge: {name} has shape {shape}: must be {(size,)}, one entry for each row")
    if outcome.over is not None and outcome.over.shape != (n,):
        raise ValueError(f"judge: over has shape {outcome.over.shape}: must be {(n,)}, one entry for each row")
    if not np.isfinite(outcome.terms.terms).all():
        place, row = (int(i) for i in np.argwhere(~np.isfinite(outcome.terms.terms))[0])
        value = outcome.terms.terms[place, row]
        raise ValueError(
            f"judge: the term {outcome.terms.names[place]!r} is {value} in world {row % n}: must be finite"
        )
    for name, worlds in (("changed", outcome.changed), ("failure", list(outcome.failure))):
        for world in worlds:
            if not 0 <= world < n:
                raise ValueError(f"judge: {name} names world {world}: must be within 0 and {n - 1}")


def _array(where: str, returned: Any, kind: Any) -> np.ndarray:
    try:
        return np.asarray(returned, kind)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{where} returned {returned!r:.80}: must be an array of numbers") from error
