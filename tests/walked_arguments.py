"""A walk of arguments: each optional parameter of a public callable changes a result, or has a reason why it does not.

A table maps names of callables ("psf", "Eye.see") to `Walk`s. A parameter that is missing in a table fails the test.
"""

import hashlib
import inspect
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class With:
    """A changed value, and further arguments of the call with and without the change."""

    value: Any
    given: dict[str, Any]


@dataclass(frozen=True)
class NoEffect:
    """The reason why a parameter cannot change a result."""

    reason: str


@dataclass(frozen=True)
class Walk:
    """A call and a changed value of each optional parameter. `call` receives the arguments and returns a result."""

    call: Callable[..., Any]
    changes: dict[str, Any]
    given: dict[str, Any] = field(default_factory=dict)

    def unchanged(self) -> list[str]:
        """Return the parameters whose change has no effect."""
        found: list[str] = []
        before: dict[str, str] = {}
        for name, change in self.changes.items():
            if isinstance(change, NoEffect):
                continue
            value, more = (change.value, change.given) if isinstance(change, With) else (change, {})
            given, key = {**self.given, **more}, _key(more)
            if key not in before:
                before[key] = digest(self.call(**given))
            if before[key] == digest(self.call(**{**given, name: value})):
                found.append(name)
        return found


def optional(callable_: Any) -> set[str]:
    """Return the names of the parameters that have a default."""
    empty = inspect.Parameter.empty
    return {each.name for each in inspect.signature(callable_).parameters.values() if each.default is not empty}


def public(package: Any) -> dict[str, set[str]]:
    """Return the optional parameters of every public callable of a package, and of the methods of its classes."""
    found: dict[str, set[str]] = {}
    for name in package.__all__:
        one = getattr(package, name)
        if not callable(one) or (inspect.isclass(one) and issubclass(one, (Exception, Warning))):
            continue
        found[name] = optional(one)
        if inspect.isclass(one):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", FutureWarning)  # renamed methods warn when they are read
                methods = {key: getattr(one, key) for key in dir(one) if not key.startswith("_")}
            own = {key: each for key, each in methods.items() if inspect.isfunction(each) or inspect.ismethod(each)}
            found |= {f"{name}.{key}": optional(each) for key, each in own.items() if each.__name__ == key}
    return {name: names for name, names in found.items() if names}


def missing(package: Any, table: dict[str, Walk]) -> list[str]:
    """Return the optional parameters without an entry, and entries without a parameter."""
    wanted = {f"{name}({each}=)" for name, names in public(package).items() for each in names}
    known = {f"{name}({each}=)" for name, walk in table.items() for each in walk.changes}
    return sorted(wanted ^ known)


def digest(result: Any) -> str:
    """Return a hash of the numbers and words of a result."""
    return hashlib.sha256(_plain(result).encode()).hexdigest()


def _key(given: dict[str, Any]) -> str:
    """Return the digest of arguments, or a name of their own if they have none."""
    try:
        return digest(given)
    except TypeError:
        return str(id(given))


def _plain(result: Any) -> str:
    if result is None or isinstance(result, (str, bool, int, type)):
        return repr(result)
    if isinstance(result, float):
        return "nan" if math.isnan(result) else repr(result)
    if isinstance(result, dict):
        return repr({str(key): _plain(value) for key, value in result.items()})
    if isinstance(result, (list, tuple, set)):
        return repr([_plain(each) for each in result])
    if hasattr(result, "numpy") and not isinstance(result, np.ndarray):
        result = result.numpy()
    if isinstance(result, np.ndarray) or np.isscalar(result):
        array = np.asarray(result)
        return f"{array.shape}{array.dtype}{array.tobytes().hex()}"
    if is_dataclass(result):
        return repr([_plain(getattr(result, each.name)) for each in fields(result)])
    raise TypeError(f"a result of type {type(result).__name__} has no digest")
