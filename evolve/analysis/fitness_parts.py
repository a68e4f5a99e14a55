"""Parts of fitness: the task fitness, which is the mean return of the evaluation episodes, and the costs.

Fitness is the task fitness minus the costs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from evolve.analysis.statistics import bootstrap_interval
from evolve.store.candidate import Candidate

__all__ = ["any_costs", "fitness_interval", "fitness_label", "fitness_text"]


def any_costs(candidates: Iterable[Candidate]) -> bool:
    """Return whether at least one candidate has costs."""
    return any(candidate.costs for candidate in candidates)


def fitness_label(costs: bool) -> str:
    """Return the label of an axis that shows fitness.

    costs: True if the fitness is reduced by costs
    """
    return "fitness (mean return − costs)" if costs else "fitness (mean return)"


def fitness_text(fitness: float, costs: float, shown: Callable[[float], str] = "{:.4g}".format) -> str:
    """Return a fitness as text; if there are costs, followed by the mean return (the task fitness) and the costs.

    shown: function that returns a number as text
    """
    parts = f" (task fitness {shown(fitness + costs)}, costs {shown(costs)})" if costs else ""
    return f"{shown(fitness)}{parts}"


def fitness_interval(candidate: Candidate) -> tuple[float, float]:
    """Return the 95 % bootstrap interval of a candidate's fitness, from the returns of its evaluation episodes.

    Fitness is the mean return minus the costs of the animal. The costs are known exactly, so they shift the interval
    but do not change its width. The interval is (NaN, NaN) for a single episode.

    Raises:
        ValueError: the candidate failed, so it has no returns.
    """
    low, high = bootstrap_interval(candidate.returns)
    return low - candidate.costs, high - candidate.costs
