"""What every world says of each step, as Gymnasium's `info`: the reward's terms, success, and where the agent is."""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.envs.simulation import Step
from sim.worlds.state import WorldState


def infos_of(step: Step) -> list[dict[str, Any]]:
    """One per world, after an action."""
    places = (*step.state.position.T.tolist(), step.state.heading.tolist())
    # In one go, the names of sim.tasks.reward.TERMS written out: this is done for every world in every step, and takes
    # a third of the time that way.
    infos = [
        {
            "reward_terms": {"progress": progress, "goal": goal, "adversary": adversary, "contact": contact},
            "is_success": success,
            "position": (x, y),
            "heading": heading,
        }
        for progress, goal, adversary, contact, success, x, y, heading in zip(
            *step.terms.tolist(), step.success.tolist(), *places, strict=True
        )
    ]
    for world in np.flatnonzero(step.adversary_first):
        infos[world]["adversary_first"] = True
    return infos


def first_infos(state: WorldState) -> list[dict[str, Any]]:
    """One per world, before the first action."""
    return [
        {"reward_terms": {}, "is_success": False, "position": (x, y), "heading": heading}
        for (x, y), heading in zip(state.position.tolist(), state.heading.tolist(), strict=True)
    ]
