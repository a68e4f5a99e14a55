"""Common parts of the built-in tasks: the sliding agent, its contact sense and its reward.

Each world has a separate random number generator for each purpose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from sim.eyes.eyes import BODY_RADIUS, Eyes
from sim.eyes.mounts import Mount, ring
from sim.physics.sliding_agents import MAX_TURN, SlidingAgents
from sim.render.fidelity import Fidelity
from sim.scene.variation import Variation
from sim.tasks.batch_task import Agent, BatchTask
from sim.tasks.command import Command
from sim.tasks.outcome import NOWHERE, Outcome, RewardTerms
from sim.tasks.random_streams import StreamsByPurpose
from sim.tasks.reward import MODES, TERMS, RewardWeights, reward_terms
from sim.tracing.lighting import DIRECT
from sim.worlds.catalog import EPISODE_STEPS
from sim.worlds.ground_plan import GroundPlan
from sim.worlds.world import MAX_SPEED, World

__all__ = ["STANDING", "AgentEvents", "AgentTask", "mounts_of_agent"]

# Height of a pupil above the agent's skin, as a fraction of the agent's radius. It keeps rounding errors from putting
# the pupil below the skin.
OUTSIDE = 1e-6
STANDING = (-1.0, 0.0)  # "previous action" at the start of an episode: no speed and no turn


@dataclass(frozen=True)
class AgentEvents:
    """Events during one action, per world.

    In training, only the first event counts, because it ends the episode: `goal` is False if the agent reached an
    adversary first, and `adversary` is False if the agent reached a goal first or at the same time.

    progress: progress as the task defines it [m], (n,)
    goal: True if a goal was reached, (n,) bool
    adversary: True if an adversary was reached, (n,) bool
    adversary_first: True if an adversary was reached, and no goal was reached before or at the same time, (n,) bool
    reached: True for objects that were reached, (n, k) bool
    terminated: True if the task ends the episode, (n,) bool
    """

    progress: np.ndarray
    goal: np.ndarray
    adversary: np.ndarray
    adversary_first: np.ndarray
    reached: np.ndarray
    terminated: np.ndarray

    @property
    def any(self) -> np.ndarray:
        """True for worlds in which a goal or an adversary was reached, (n,) bool."""
        return self.goal | self.adversary

    def within(self, worlds: np.ndarray) -> AgentEvents:
        """Return a copy of the events without the events of worlds for which `worlds` (n,) is False."""
        return AgentEvents(
            progress=np.where(worlds, self.progress, 0.0),
            goal=self.goal & worlds,
            adversary=self.adversary & worlds,
            adversary_first=self.adversary_first & worlds,
            reached=self.reached & worlds[:, None],
            terminated=self.terminated & worlds,
        )


class AgentTask(BatchTask):
    """A task in one of the built-in worlds, in which an agent slides over the floor between walls.

    world: the compiled world
    mode: "training", "evaluation" or "test". The mode determines the weights of the reward, and which events end an
        episode, see `sim.tasks.reward`
    eyes: eyes on the agent's equator (the horizontal circle around its body), or a dictionary of several kinds of
        eyes by name; None: no eyes
    fidelity: fidelity of the eyes, or "auto"
    """

    proprioception_ranges: Mapping[str, tuple[float, float]] = {"contact": (0.0, 1.0)}
    ramped = ("contact",)
    counted: Mapping[str, str] = {
        "goal": "goals reached",
        "adversary": "adversaries reached",
        "contact": "actions in contact",
    }
    compared_light = DIRECT

    def __init__(
        self,
        world: World,
        mode: str = "training",
        eyes: Eyes | Mapping[str, Eyes] | None = None,
        fidelity: Fidelity | str = "auto",
    ) -> None:
        self.world, self.model, self.mode, self.name, self.eyes = world, world.model, mode, world.task, eyes
        self.spectra, self.episode_steps = world.spectra, world.episode_steps or EPISODE_STEPS
        self.fidelity, self.medium = fidelity, world.medium
        if isinstance(eyes, Eyes):
            self.eye, self.mounts = eyes.eye(), mounts_of_agent(eyes)
        elif eyes is not None:
            self.eye = {name: of_kind.eye() for name, of_kind in eyes.items()}
            self.mounts = {name: mounts_of_agent(of_kind) for name, of_kind in eyes.items()}

    @property
    def weights(self) -> RewardWeights:
        """Weights of the reward's terms."""
        return MODES[self.mode]

    def n_actions(self, model: mujoco.MjModel) -> int:
        """Return 2, because an action consists of two values: the forward speed and the change of heading."""
        return 2

    def commands(self) -> tuple[Command, ...]:
        return (Command("speed", "m/s", MAX_SPEED / 2, 1.0), Command("turn", "°", np.degrees(MAX_TURN)))

    def solved(self, before: bool | None, info: Mapping[str, Any]) -> bool | None:
        """Return True if the agent reached a goal (or the goal region) first, False if it reached an adversary first.

        Return None if it has reached neither.
        """
        if before is not None:
            return before
        if info.get("adversary_first"):
            return False
        return True if info["reward_terms"]["goal"] > 0 else None

    def azimuths(self) -> np.ndarray:
        return self.eyes.azimuths() if isinstance(self.eyes, Eyes) else super().azimuths()

    def ground_plan(self, place: np.ndarray) -> GroundPlan:
        return GroundPlan.from_world(self.world, place)

    def physics(self, n: int, threads: int, variation: Variation | None) -> SlidingAgents:
        return SlidingAgents(self.world, n, threads, variation)

    def streams(self, seed: Any, n: int) -> StreamsByPurpose:
        return StreamsByPurpose(seed, n, [len(agent.kinds) for agent in self.agents()])

    def agents(self) -> tuple[Agent, ...]:
        (agent,) = super().agents()
        return (replace(agent, first_action=np.array(STANDING, np.float32)),)

    def act(self, worlds: SlidingAgents, actions: np.ndarray) -> None:
        """Steer the agents by these actions, and move the objects.

        actions: forward speed and change of heading, each in [-1, 1], (n, 2)
        """
        worlds.steer(actions)
        worlds.move_objects(*self.moved(worlds))

    def moved(self, worlds: SlidingAgents) -> tuple[np.ndarray, np.ndarray]:
        """Return the positions (n, k, 3) [m] and headings (n, k) [rad] of the objects after the next action.

        By default, objects do not move.
        """
        return worlds.state.objects, worlds.state.object_heading

    def proprioception(self, worlds: SlidingAgents) -> Mapping[str, np.ndarray]:
        """Return the entry "contact", (n, 1): 1 if the agent touched a wall during the last action, else 0.

        At the start of an episode, it is 0.
        """
        touched = np.zeros(worlds.n, bool) if worlds.motion is None else worlds.motion.contact
        return {"contact": (touched & (worlds.state.steps > 0)).astype(np.float32)[:, None]}

    def first_info(self, worlds: SlidingAgents, chosen: np.ndarray) -> Sequence[Mapping[str, Any]]:
        state = worlds.state
        places = zip(state.position[chosen].tolist(), state.heading[chosen].tolist(), strict=True)
        return [{"position": (x, y), "heading": heading} for (x, y), heading in places]

    def weighted(self, worlds: SlidingAgents, events: AgentEvents, failed: Mapping[int, str]) -> Outcome:
        """Return the outcome of an action that caused these events, with the weighted terms of the reward.

        The goals and adversaries that were reached are counted, and `put_elsewhere` moves reached objects.

        failed: the worlds that could not continue, each with the reason; their events are ignored
        """
        if failed:
            well = np.ones(worlds.n, bool)
            well[list(failed)] = False
            events = events.within(well)
        assert worlds.motion is not None
        terms = reward_terms(self.weights, events.progress, events.goal, events.adversary, worlds.motion.contact)
        terminated = events.terminated | ~well if failed else events.terminated
        changed = NOWHERE
        if events.any.any():
            worlds.count(events.goal, events.adversary)
            changed = self.put_elsewhere(worlds, events)
        state = worlds.state
        places = zip(*state.position.T.tolist(), state.heading.tolist(), strict=True)
        info: list[dict[str, Any]] = [{"position": (x, y), "heading": heading} for x, y, heading in places]
        for world in events.adversary_first.nonzero()[0]:
            info[world]["adversary_first"] = True
        return Outcome(
            terms=RewardTerms(TERMS, terms),
            terminated=terminated,
            success=state.goals_reached > 0,
            failure=failed,
            changed=changed,
            info=info,
        )

    def put_elsewhere(self, worlds: SlidingAgents, events: AgentEvents) -> np.ndarray:
        """Move each reached object if the episode continues. Return the worlds in which objects were moved.

        By default, no object moves.
        """
        return NOWHERE


def mounts_of_agent(eyes: Eyes) -> tuple[Mount, ...]:
    """Return the mounts of these eyes on the agent's equator, the horizontal circle around its body."""
    return ring("agent", eyes.n_eyes, eyes.placement_range_deg, BODY_RADIUS * (1 + OUTSIDE))
