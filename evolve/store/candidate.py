"""One evaluated candidate, and its line in a run's record."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evolve.config.numbering import Place
from evolve.genome.phenotype import Phenotype
from evolve.store.evaluation import Evaluation

__all__ = ["Candidate"]


@dataclass(frozen=True)
class Candidate:
    """A genome, the animal it became, and how that one fared; see `Evaluation` for the fields it has in common.

    parents: ids of the candidates from which the search made it; () where it drew from none
    rung: budget stage after which it was evaluated, 0 the first; steps and seconds are from the beginning
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
        return json.dumps(_finite(record), allow_nan=False) + "\n"

    @classmethod
    def from_line(cls, line: str) -> Candidate:
        """Inverse of `to_line`.

        Raises:
            ValueError: says what is wrong with the line.
        """
        record = json.loads(line)
        if isinstance(record, dict):
            record = {"parents": [], "rung": 0, **record}  # not written by the first runs
        names = [f.name for f in fields(cls)]
        if not isinstance(record, dict) or sorted(record) != sorted(names):
            raise ValueError(f"wrong fields: must hold exactly {', '.join(names)}")
        try:
            return cls(
                id=int(record["id"]),
                generation=int(record["generation"]),
                index=int(record["index"]),
                genome=tuple(float(u) for u in record["genome"]),
                phenotype=Phenotype.from_json(record["phenotype"]),
                seed=int(record["seed"]),
                fitness=-math.inf if record["fitness"] is None else float(record["fitness"]),
                returns=tuple(_number(value) for value in record["returns"]),
                success_rate=_number(record["success_rate"]),
                steps=int(record["steps"]),
                seconds=float(record["seconds"]),
                curve=tuple((int(steps), _number(value)) for steps, value in record["curve"]),
                failure=None if record["failure"] is None else str(record["failure"]),
                parents=tuple(int(parent) for parent in record["parents"]),
                rung=int(record["rung"]),
            )
        except (TypeError, AttributeError, KeyError) as error:
            raise ValueError(f"a value has the wrong type ({error})") from error


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _finite(value: Any) -> Any:
    """JSON has no infinity and no NaN: null stands for them."""
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
