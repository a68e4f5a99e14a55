"""One evaluated candidate, and its line in a run's record."""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evolve.config.numbering import Place
from evolve.genome.interval import Interval
from evolve.genome.phenotype import Phenotype
from evolve.genome.plain_values import listed, parsed, real, whole_number
from evolve.store.evaluation import Evaluation

__all__ = ["Candidate"]


@dataclass(frozen=True)
class Candidate:
    """A genome, the animal it became, and how that one fared; see `Evaluation` for the fields it has in common.

    parents: ids of the candidates from which the search made it; () where it drew from none
    rung: budget stage after which it was evaluated, 0 the first; steps and seconds are from the beginning
    policy: SHA-256 of the file of its trained policy; None where it has none, or was written down by a former version
    """

    id: int
    generation: int
    index: int
    genome: tuple[float, ...]
    phenotype: Phenotype
    seed: int
    fitness: float
    returns: tuple[float, ...]
    success_rate: float
    steps: int
    seconds: float
    curve: tuple[tuple[int, float], ...]
    failure: str | None
    parents: tuple[int, ...] = ()
    rung: int = 0
    policy: str | None = None
    mishaps: tuple[tuple[str, int], ...] = ()

    def __repr__(self) -> str:
        """Short: a record holds thousands."""
        outcome = f"failed: {self.failure}" if self.failure is not None else f"fitness {self.fitness:.4g}"
        return f"<Candidate {self.id}, generation {self.generation}, {outcome}>"

    @property
    def place(self) -> Place:
        """Where it stands in the search."""
        return Place(self.id, self.generation, self.index)

    @property
    def vector(self) -> NDArray[np.float64]:
        """The genome as an array."""
        return np.array(self.genome)

    @classmethod
    def of(
        cls,
        place: Place,
        genome: tuple[float, ...],
        phenotype: Phenotype,
        seed: int,
        outcome: Evaluation,
        parents: tuple[int, ...] = (),
    ) -> Candidate:
        """Candidate at `place` with its outcome; a fitness that is no number is a failure."""
        if outcome.failure is None and not math.isfinite(outcome.fitness):
            outcome = Evaluation.failed(f"fitness is {outcome.fitness}", outcome.seconds)
        found = {f.name: getattr(outcome, f.name) for f in fields(Evaluation)}
        return cls(**vars(place), genome=genome, phenotype=phenotype, seed=seed, **found, parents=parents)

    def to_line(self) -> str:
        """One line of JSON; numbers are written so that they read back bit for bit, and what is no number as null."""
        record = {**vars(self), "phenotype": self.phenotype.to_json()}
        if not self.mishaps:
            del record["mishaps"]
        return json.dumps(_finite(record), allow_nan=False) + "\n"

    @classmethod
    def from_line(cls, line: str) -> Candidate:
        """Inverse of `to_line`.

        Raises:
            ValueError: says what is wrong with the line.
        """
        record = parsed(line)
        if isinstance(record, dict):
            # The first runs wrote none of these, and no run writes that nothing went wrong.
            record = {"parents": [], "rung": 0, "policy": None, "mishaps": [], **record}
        names = [f.name for f in fields(cls)]
        if not isinstance(record, dict) or sorted(record) != sorted(names):
            raise ValueError(f"wrong fields: must hold exactly {', '.join(names)}")
        try:
            candidate = cls(
                **{name: whole_number(record[name], name, 0, most) for name, most in _COUNTS.items()},
                genome=_reals(record, "genome"),
                phenotype=Phenotype.from_json(record["phenotype"]),
                fitness=-math.inf if record["fitness"] is None else real(record["fitness"], "fitness", _ANY),
                returns=_reals(record, "returns", or_none=True),
                success_rate=_real_or_none(record["success_rate"], "success_rate", Interval(0, 1)),
                seconds=real(record["seconds"], "seconds", Interval(0, 1e300)),
                curve=tuple(_point(entry) for entry in listed(record["curve"], "curve", 0, _LONGEST)),
                failure=_text(record["failure"], "failure"),
                policy=_checksum(record["policy"]),
                mishaps=tuple(_mishap(entry) for entry in listed(record["mishaps"], "mishaps", 0, _LONGEST)),
                parents=tuple(
                    whole_number(one, "parents", 0, _COUNTS["id"])
                    for one in listed(record["parents"], "parents", 0, _LONGEST)
                ),
            )
        except TypeError as error:
            raise ValueError(f"a value has the wrong type ({error})") from error
        candidate._require_success()
        return candidate

    def _require_success(self) -> None:
        """Whoever has not failed has a fitness, and returns that it comes from."""
        if self.failure is not None:
            return
        if not math.isfinite(self.fitness):
            raise ValueError("fitness = null: must be a number, or failure must say why there is none")
        if not self.returns or not all(map(math.isfinite, (*self.returns, self.success_rate))):
            raise ValueError("returns, success_rate: must be numbers, as nothing has failed")


_ANY = Interval(-1e300, 1e300)
_LONGEST = 1_000_000  # entries of a list
# The largest of each: ids and generations are as many as settings allow, seeds what generators take.
_COUNTS = {"id": 10**9, "generation": 10**5, "index": 10**4, "seed": 2**64 - 1, "steps": 10**12, "rung": 9}


def _reals(record: dict[str, Any], name: str, or_none: bool = False) -> tuple[float, ...]:
    values = listed(record[name], name, 0, _LONGEST)
    return tuple(_real_or_none(value, name, _ANY) if or_none else real(value, name, _ANY) for value in values)


def _real_or_none(value: Any, name: str, valid: Interval) -> float:
    return math.nan if value is None else real(value, name, valid)


def _point(entry: Any) -> tuple[int, float]:
    steps, value = listed(entry, "curve", 2, 2)
    return whole_number(steps, "curve", 0, _COUNTS["steps"]), _real_or_none(value, "curve", _ANY)


def _mishap(entry: Any) -> tuple[str, int]:
    said, episodes = listed(entry, "mishaps", 2, 2)
    text = _text(said, "mishaps")
    if text is None:
        raise ValueError("mishaps: must say what went wrong")
    return text, whole_number(episodes, "mishaps", 1, _COUNTS["steps"])


def _text(value: Any, name: str) -> str | None:
    """Text as it can be printed: a file's name in it, say in why a candidate failed, may be no text at all."""
    if value is not None and not isinstance(value, str):
        raise ValueError(f"{name}: must be text or null")
    return value if value is None else value.encode(errors="backslashreplace").decode()


def _checksum(value: Any) -> str | None:
    """Of a policy's file, as `evolve.store.policies.digest` writes it."""
    if value is not None and (not isinstance(value, str) or re.fullmatch("[0-9a-f]{64}", value) is None):
        raise ValueError("policy: must be a SHA-256 in 64 lower-case hexadecimal digits, or null")
    return value


def _finite(value: Any) -> Any:
    """JSON has no infinity and no NaN: null stands for them."""
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
