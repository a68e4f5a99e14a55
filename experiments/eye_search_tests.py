"""Tests of the searches for eyes, as planned in docs/results/eye_searches_plan.md."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from experiments.candidates import Row
from experiments.contrast import Contrast, contrast, holm
from experiments.evolved import Store, null_model
from experiments.eye_factors_design import TASKS
from experiments.eye_searches import SEEDS
from experiments.goals_shape_eyes import QUANTITIES, TOGETHER
from experiments.means import last_values

__all__ = [
    "CLAIMS",
    "COMPARED",
    "LEVEL",
    "TESTED",
    "Claim",
    "Exploratory",
    "adjusted",
    "compared",
    "exploratory",
    "group",
    "outcome",
    "seeds",
]

LEVEL = 0.05
TESTED = ("free", "priced")  # kinds of searches that are compared between the tasks
PLACEMENT = "placement range [°]"
COMPARED: dict[str, Callable[[Row], float]] = {
    name: QUANTITIES[name] for name in (TOGETHER, "eyes", "receptors per eye, across", PLACEMENT)
}


def group(task: str, kind: str) -> str:
    """Return the name of a group of searches, such as "maze, free"."""
    return f"{task}, {kind}"


def complete(store: Store, kind: str) -> bool:
    """Return whether the store contains the searches of a kind, which are collected only when all are complete."""
    return all(store.group(group(task, kind)) for task in TASKS)


def compared(store: Store, kind: str) -> Contrast | None:
    """Return the test of one kind of searches: ln(receptors across / eyes) in detection minus that in mazes.

    The result is None if the searches are not complete.
    """
    if not complete(store, kind):
        return None
    return contrast(store, TOGETHER, COMPARED[TOGETHER], *(group(task, kind) for task in TASKS))


def adjusted(store: Store) -> dict[str, float]:
    """Return the p-values of the tests by kind, adjusted for two tests (Holm 1979).

    A test that cannot be computed yet counts with p = 1, so that the adjusted value of the other one is an upper limit.
    """
    found = [compared(store, kind) for kind in TESTED]
    return dict(zip(TESTED, holm([1.0 if one is None else one.p for one in found]), strict=True))


def outcome(store: Store) -> str:
    """Return the outcome that the plan defines: reproduced, reproduced with prices, not reproduced, or open."""
    ps = adjusted(store)
    found = {kind: compared(store, kind) for kind in TESTED}
    for kind, told in zip(TESTED, ("reproduced", "reproduced with prices"), strict=True):
        one = found[kind]
        if one is None:
            return "open"
        if one.value > 0 and ps[kind] <= LEVEL:
            return told
    return "not reproduced"


@dataclass(frozen=True)
class Claim:
    """A claim about the eyes that evolve in one task.

    sign: 1 if the claim expects a larger value than searches with random fitness have, -1 for a smaller one
    """

    text: str
    task: str
    quantity: str
    sign: int


CLAIMS = (
    Claim("few eyes in detection", "detection", "eyes", -1),
    Claim("eyes that look ahead in detection", "detection", PLACEMENT, -1),
    Claim("fine eyes in detection", "detection", "receptors per eye, across", 1),
    Claim("many eyes in mazes", "maze", "eyes", 1),
    Claim("eyes around the body in mazes", "maze", PLACEMENT, 1),
    Claim("coarse eyes in mazes", "maze", "receptors per eye, across", -1),
)


@dataclass(frozen=True)
class Exploratory:
    """Exploratory test of a claim.

    value: mean over the last generations and over the searches
    median: median under the null model
    p: two-sided p-value, not adjusted
    state: supported, contradicted or open
    """

    value: float
    median: float
    p: float
    state: str


def exploratory(store: Store, claim: Claim, kind: str) -> Exploratory | None:
    """Return the test of a claim in one kind of searches; None if these are not complete, or if no animal has a value.

    The claim is contradicted if the difference from the null model is significant and has the other sign.
    """
    name = group(claim.task, kind)
    rows = store.group(name)
    null = null_model(store, name, claim.quantity, rows)
    values = [float(one.mean()) for one in last_values(rows, COMPARED[claim.quantity])]
    if not complete(store, kind) or null is None or not values:
        return None
    value, p = float(np.mean(values)), null.p(*values)
    expected = claim.sign * (value - null.median) > 0
    state = "open" if p > LEVEL else "supported" if expected else "contradicted"
    return Exploratory(value, null.median, p, state)


def seeds(store: Store, kind: str) -> str:
    """Return the number of stored searches of a kind and of planned ones, such as "6 of 6"."""
    stored = {(row.group, row.seed) for task in TASKS for row in store.group(group(task, kind))}
    return f"{len(stored)} of {len(TASKS) * len(SEEDS)}"
