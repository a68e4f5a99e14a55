"""One evaluated candidate, and its line in a run's record."""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evolve.config.numbering import Place
from evolve.genome.interval import Interval
from evolve.genome.phenotype import Phenotype
from evolve.genome.plain_values import listed, parsed, real, whole_number
from evolve.store.evaluation import Evaluation, escaped, shortened
from optics.numerics.renamed import renamed

__all__ = ["Candidate"]


@dataclass(frozen=True)
class Candidate:
    """A genome, its phenotype, and the outcome of training and evaluation.

    `Evaluation` describes the fields that are not listed here.

    id, generation, index: see `Place`
    genome: coordinates in [0, 1] of the genes that the search varies, see `Genotype`
    phenotype: eyes and brain of the animal
    seed: seed of training and evaluation
    fitness: task fitness minus costs; -inf if the candidate failed. The search maximises the fitness.
    parents: ids of the candidates from which the search derived the genome; () if there are none
    rung: number (0, 1, ...) of the part of training before the evaluation; steps and seconds include earlier parts
    policy: SHA-256 of the trained policy's file; None if there is no policy, or if an older version wrote the record
    costs: costs of eyes and brain (`evolve.config.costs`); 0 for a failed candidate
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
    episode_failures: tuple[tuple[str, int], ...] = ()
    costs: float = 0.0

    def __repr__(self) -> str:
        """Return a short description, because a record may contain thousands of candidates."""
        outcome = f"failed: {self.failure}" if self.failure is not None else f"fitness {self.fitness:.4g}"
        return f"<Candidate {self.id}, generation {self.generation}, {outcome}>"

    mishaps, of = renamed("episode_failures"), renamed("from_evaluation")

    @property
    def place(self) -> Place:
        """Id of the candidate, its generation, and its number in this generation."""
        return Place(self.id, self.generation, self.index)

    @property
    def task_fitness(self) -> float:
        """Mean of `returns`, from which no costs are subtracted; -inf if the candidate failed."""
        return self.fitness + self.costs

    @property
    def vector(self) -> NDArray[np.float64]:
        """The genome as an array, (gene,)."""
        return np.array(self.genome)

    @classmethod
    def from_evaluation(
        cls,
        place: Place,
        genome: tuple[float, ...],
        phenotype: Phenotype,
        seed: int,
        outcome: Evaluation,
        parents: tuple[int, ...] = (),
    ) -> Candidate:
        """Return a candidate with this place and outcome; values that cannot be stored are changed (see `recordable`).

        The place consists of the candidate's id, its generation, and its number in this generation. A candidate whose
        fitness is not finite counts as failed. No costs are subtracted from the fitness yet; see `charged`.

        Raises:
            ValueError: the place, genome, phenotype, seed or parents cannot be recorded.
        """
        if outcome.failure is None and not math.isfinite(outcome.fitness):
            outcome = Evaluation.failed(f"fitness is {outcome.fitness}", outcome.seconds)
        found = {f.name: getattr(outcome, f.name) for f in fields(Evaluation)}
        candidate = cls(**vars(place), genome=genome, phenotype=phenotype, seed=seed, **found, parents=parents)
        return candidate.recordable()

    def charged(self, costs: float) -> Candidate:
        """Return the candidate after subtracting costs from its fitness. A failed candidate is unchanged."""
        free = self.failure is not None or not costs
        return self if free else replace(self, fitness=self.fitness - costs, costs=self.costs + costs)

    def recordable(self) -> Candidate:
        """Return the candidate as it is after it has been written to a run's record and read back.

        Invalid characters in messages are escaped, long messages are shortened, and infinity in a list becomes NaN. If
        a value of the outcome has the wrong type or is outside the range that a record allows, the candidate counts as
        failed. `failure` then states why; `seconds` and `episode_failures` are kept if both can be recorded.

        Raises:
            ValueError: another value, such as the genome or the seed, cannot be recorded.
        """
        try:
            return self._restored()
        except ValueError as error:
            failure = self.failure if isinstance(self.failure, str) else f"its outcome cannot be recorded: {error}"
        try:
            return self._failed(failure, seconds=self.seconds, episode_failures=self.episode_failures)._restored()
        except ValueError:
            return self._failed(failure)._restored()

    def _failed(self, failure: str, **kept: Any) -> Candidate:
        """Return the candidate as failed. Its outcome is reset, except the fields given in `kept` as name=value."""
        return replace(self, **{**vars(Evaluation.failed(failure)), **kept}, policy=None, costs=0.0)

    def _restored(self) -> Candidate:
        """Return the candidate that results from converting this one to a line of the record and reading the line.

        Raises:
            ValueError: a value cannot be written or read back; the message states the reason.
        """
        try:
            candidate = Candidate.from_line(self.to_line())
        except TypeError as error:
            raise ValueError(str(error)) from error
        # NaN does not equal itself. It can occur only as the success rate of a failed candidate.
        return candidate if math.isfinite(candidate.success_rate) else replace(candidate, success_rate=0.0)

    def to_line(self) -> str:
        """Return the candidate as a line of JSON.

        Finite numbers can be restored bit for bit. NaN and infinity become null, and lone surrogates in text are
        escaped. If there are costs, the line contains them and the task fitness; otherwise, both keys are omitted.

        Raises:
            TypeError: a value has a type that JSON lacks.
        """
        record = {KEYS.get(name, name): value for name, value in vars(self).items()}
        record["phenotype"] = self.phenotype.to_json()
        if self.costs:
            record["task_fitness"] = self.task_fitness
        else:
            del record["costs"]
        if not self.episode_failures:
            del record["mishaps"]
        return json.dumps(_json_value(record), allow_nan=False) + "\n"

    @classmethod
    def from_line(cls, line: str) -> Candidate:
        """Return the candidate from a line that `to_line` of this or an older version of rhabdom returned.

        Raises:
            ValueError: the line is invalid; the message states the reason.
        """
        record = parsed(line)
        if isinstance(record, dict):
            # Records of the first versions lack these fields. An empty list of failures is never written.
            record = {"parents": [], "rung": 0, "policy": None, "mishaps": [], "costs": 0.0, **record}
        names = [KEYS.get(f.name, f.name) for f in fields(cls)]
        task_fitness = record.pop("task_fitness", None) if isinstance(record, dict) else None
        if not isinstance(record, dict) or sorted(record) != sorted(names):
            raise ValueError(f"wrong fields: must be exactly {', '.join(names)}")
        try:
            candidate = cls(
                **{name: whole_number(record[name], name, 0, most) for name, most in _COUNTS.items()},
                genome=_reals(record, "genome"),
                phenotype=Phenotype.from_json(record["phenotype"]),
                fitness=-math.inf if record["fitness"] is None else real(record["fitness"], "fitness", _ANY),
                returns=_reals(record, "returns", or_none=True, most=_MOST_RETURNS),
                costs=_not_negative(record["costs"], "costs"),
                success_rate=_real_or_none(record["success_rate"], "success_rate", Interval(0, 1)),
                seconds=_not_negative(record["seconds"], "seconds"),
                curve=tuple(_point(entry) for entry in listed(record["curve"], "curve", 0, _LONGEST)),
                failure=_text(record["failure"], "failure"),
                policy=_checksum(record["policy"]),
                episode_failures=tuple(
                    _episode_failure(entry) for entry in listed(record["mishaps"], "mishaps", 0, _LONGEST)
                ),
                parents=tuple(
                    whole_number(one, "parents", 0, _COUNTS["id"])
                    for one in listed(record["parents"], "parents", 0, _LONGEST)
                ),
            )
        except TypeError as error:
            raise ValueError(f"a value has the wrong type ({error})") from error
        candidate._require_success()
        if task_fitness != (candidate.task_fitness if candidate.costs else None):
            raise ValueError("task_fitness: must be fitness + costs if there are costs, else absent")
        return candidate

    def _require_success(self) -> None:
        """Check that a candidate has fitness, returns and success rate, or has failed with no costs subtracted.

        Raises:
            ValueError: the candidate does not meet these conditions.
        """
        if self.failure is not None:
            if self.costs:
                raise ValueError("costs: must be 0 or absent if the candidate failed")
            return
        if not math.isfinite(self.fitness):
            raise ValueError("fitness = null: must be a number, or failure must state the reason")
        if not self.returns or not all(map(math.isfinite, (*self.returns, self.success_rate))):
            raise ValueError("returns, success_rate: must be numbers if failure is null")


KEYS = {"episode_failures": "mishaps"}  # name of a field -> its name in records, if it differs
_ANY = Interval(-1e300, 1e300)
_LONGEST = 1_000_000  # maximum number of entries of a list in a record
_MOST_RETURNS = 10_000  # maximum number of evaluation episodes, see the settings
# Maximum values in a record. The ranges of the settings limit ids and generations; random generators limit seeds.
_COUNTS = {"id": 10**9, "generation": 10**5, "index": 10**4, "seed": 2**64 - 1, "steps": 10**12, "rung": 9}


def _not_negative(value: Any, name: str) -> float:
    """Return `value` as a float of at least 0.

    The function `real` is not enough for this check: it tolerates values that are slightly outside a wide range.

    Raises:
        ValueError: the value is negative or not a number.
    """
    if (number := real(value, name, _ANY)) < 0:
        raise ValueError(f"{name} = {number}: must be 0 or more")
    return number


def _reals(record: dict[str, Any], name: str, or_none: bool = False, most: int = _LONGEST) -> tuple[float, ...]:
    values = listed(record[name], name, 0, most)
    return tuple(_real_or_none(value, name, _ANY) if or_none else real(value, name, _ANY) for value in values)


def _real_or_none(value: Any, name: str, valid: Interval) -> float:
    return math.nan if value is None else real(value, name, valid)


def _point(entry: Any) -> tuple[int, float]:
    steps, value = listed(entry, "curve", 2, 2)
    return whole_number(steps, "curve", 0, _COUNTS["steps"]), _real_or_none(value, "curve", _ANY)


def _episode_failure(entry: Any) -> tuple[str, int]:
    said, episodes = listed(entry, "mishaps", 2, 2)
    text = _text(said, "mishaps")
    if text is None:
        raise ValueError("mishaps: must contain a message")
    return text, whole_number(episodes, "mishaps", 1, _COUNTS["steps"])


def _text(value: Any, name: str) -> str | None:
    """Return a failure message of a record, or None. Invalid characters are escaped, and long messages are shortened.

    A message may contain a file name with invalid characters. Older versions recorded messages of any length.

    Raises:
        ValueError: the value is neither text nor None.
    """
    if value is not None and not isinstance(value, str):
        raise ValueError(f"{name}: must be text or null")
    return value if value is None else shortened(escaped(value))


def _checksum(value: Any) -> str | None:
    """Return the given value if it is a valid SHA-256 of a policy's file, or None.

    Raises:
        ValueError: the value is neither a SHA-256 in hexadecimal digits nor None.
    """
    if value is not None and (not isinstance(value, str) or re.fullmatch("[0-9a-f]{64}", value) is None):
        raise ValueError("policy: must be a SHA-256 in 64 lower-case hexadecimal digits, or null")
    return value


def _json_value(value: Any) -> Any:
    """Return a value that JSON can represent: infinity and NaN become None, and lone surrogates in text are escaped."""
    if isinstance(value, dict):
        return {key: _json_value(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_json_value(entry) for entry in value]
    if isinstance(value, str):
        return escaped(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value
