"""Random number generators ("streams") of the worlds.

There are two schemes: a generator for each world and purpose, or a generator for each world. In both schemes, the
episodes of a world do not depend on the number of worlds.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, Protocol

import numpy as np

__all__ = ["MotionNoise", "RandomStreams", "StreamsByPurpose", "StreamsByWorld"]

# Number of actions for which random numbers are drawn in advance. One call per world and action would take longer than
# drawing the numbers.
AHEAD = 64


class RandomStreams(Protocol):
    """Protocol of the random number generators of all worlds.

    entropy: seed of all generators; another simulation with this seed has the same episodes
    noise_keys: for each agent, keys of its receptors' noise (`sim.render.receptor_noise`), (kind of eyes, world) uint64
    """

    entropy: Any
    noise_keys: list[np.ndarray]

    @property
    def episodes(self) -> list[np.random.Generator]:
        """Generators that `reset` uses at the start of episodes, one for each world."""

    @property
    def variation(self) -> list[np.random.Generator]:
        """Generators of the quantities that vary between episodes, one for each world."""

    def get_state(self) -> dict[str, np.ndarray]:
        """Return the state of all generators; the first axis of each array is the world."""

    def set_state(self, state: Mapping[str, np.ndarray], worlds: np.ndarray) -> None:
        """Restore the state of these worlds from the return value of `get_state`."""


class StreamsByPurpose:
    """One generator for each world and purpose. The built-in tasks use this scheme.

    The seed of a generator depends only on the seed of the batch, the index of the world and the purpose. With a tuple
    of seeds, it depends only on the seed of the world and the purpose.

    seed: a seed for all worlds, None for a random seed, or a tuple with a seed for each world
    n: number of worlds
    kinds: number of kinds of eyes of each agent: a sequence of one number, because built-in tasks have one agent

    Attribute `motion`: random numbers for objects that move at random.
    """

    def __init__(self, seed: Any, n: int, kinds: Sequence[int] = (1,)) -> None:
        self.entropy, roots = _roots(seed, n)

        def children(*purpose: int) -> list[np.random.SeedSequence]:
            return [np.random.SeedSequence(entropy, spawn_key=(i, *purpose)) for entropy, i in roots]

        self.episodes, motion = (
            [np.random.Generator(np.random.PCG64(child)) for child in children(purpose)] for purpose in (0, 1)
        )
        self.motion = MotionNoise(motion)
        self._of_variation = children(3)
        (count,) = kinds
        keys = [children(2) if kind == 0 else children(2, kind) for kind in range(count)]
        self.noise_keys = [np.array([[c.generate_state(1, np.uint64)[0] for c in of_kind] for of_kind in keys])]

    @cached_property
    def variation(self) -> list[np.random.Generator]:
        """One generator for each world, for the quantities that vary between episodes, such as the light."""
        return [np.random.Generator(np.random.PCG64(child)) for child in self._of_variation]

    def get_state(self) -> dict[str, np.ndarray]:
        return {"chance": _states(self.episodes), "varying": _states(self.variation), **self.motion.get_state()}

    def set_state(self, state: Mapping[str, np.ndarray], worlds: np.ndarray) -> None:
        _set_states(self.episodes, state["chance"], worlds)
        _set_states(self.variation, state["varying"], worlds)
        self.motion.set_state(state, worlds)


class StreamsByWorld:
    """One generator for each world, for all random numbers of the world's episodes except the receptors' noise.

    User tasks use this scheme. The receptors' noise depends on this object's attribute `noise_keys` instead.

    seed, n: see `StreamsByPurpose`
    kinds: number of kinds of eyes of each agent
    """

    def __init__(self, seed: Any, n: int, kinds: Sequence[int] = (1,)) -> None:
        self.entropy, roots = _roots(seed, n)
        children = [np.random.SeedSequence(entropy, spawn_key=(i,)) for entropy, i in roots]
        self.episodes = self.variation = [np.random.default_rng(child) for child in children]
        drawn = np.array([child.generate_state(sum(kinds), np.uint64) for child in children]).T
        # The first keys go to the first kind of eyes of every agent. A second kind of eyes of one agent therefore does
        # not change the noise in the first kind of the other agents.
        more, self.noise_keys = len(kinds), []
        for number, count in enumerate(kinds):
            self.noise_keys.append(np.concatenate([drawn[number : number + 1], drawn[more : more + count - 1]]))
            more += count - 1

    def get_state(self) -> dict[str, np.ndarray]:
        return {"chance": _states(self.episodes)}

    def set_state(self, state: Mapping[str, np.ndarray], worlds: np.ndarray) -> None:
        _set_states(self.episodes, state["chance"], worlds)


class MotionNoise:
    """Random numbers for moving objects. Each world draws the numbers for its actions from a separate generator."""

    def __init__(self, generators: list[np.random.Generator]) -> None:
        self._generators = generators
        self._drawn = np.empty((0, 2, len(generators), 0))

    def next(self, movers: int) -> tuple[np.ndarray, np.ndarray]:
        """Return standard normal numbers, and uniform numbers in [-1, 1), for the next action.

        Both arrays contain one number for each moving object in each world, (world, movers).
        """
        if not len(self._drawn):
            shape = (AHEAD, movers)
            of_worlds = [(rng.standard_normal(shape), rng.uniform(-1, 1, shape)) for rng in self._generators]
            self._drawn = np.ascontiguousarray(np.transpose(of_worlds, (2, 1, 0, 3)))
        (normal, uniform), self._drawn = self._drawn[0], self._drawn[1:]
        return normal, uniform

    def get_state(self) -> dict[str, np.ndarray]:
        """Return the states of the generators, and the remaining numbers that were drawn in advance.

        The array of numbers has the shape (world, action, 2, moving object), with 64 actions. On the axis of length 2,
        a standard normal number comes first, then a uniform number in [-1, 1). The remaining numbers are at the end of
        the axis of actions. All entries before them are NaN.
        """
        left, _, n, movers = self._drawn.shape
        ahead = np.full((n, AHEAD, 2, movers), np.nan)
        ahead[:, AHEAD - left :] = np.transpose(self._drawn, (2, 0, 1, 3))
        return {"motion": _states(self._generators), "motion_ahead": ahead}

    def set_state(self, state: Mapping[str, np.ndarray], worlds: np.ndarray) -> None:
        """Restore the state of these worlds from the return value of `get_state`.

        All worlds draw numbers for 64 actions at the same time, and use those of one action per step. All worlds must
        therefore have numbers left for equally many actions.

        Raises:
            ValueError: only some worlds are restored, and `state` has numbers left for more or fewer actions than the
                other worlds.
        """
        _set_states(self._generators, state["motion"], worlds)
        ahead = np.asarray(state["motion_ahead"])
        left = AHEAD - int(np.isnan(ahead[0]).any(axis=(1, 2)).sum()) if ahead.shape[-1] else 0
        if len(worlds) == len(self._generators):
            self._drawn = np.ascontiguousarray(np.transpose(ahead[:, AHEAD - left :], (1, 2, 0, 3)))
            return
        if left != len(self._drawn):
            raise ValueError(
                "state: objects of other worlds have moved another number of times: must be set for all worlds at once"
            )
        self._drawn[:, :, worlds] = np.transpose(ahead[worlds, AHEAD - left :], (1, 2, 0, 3))


def _roots(seed: Any, n: int) -> tuple[Any, list[tuple[Any, int]]]:
    """Return the entropy of the whole batch, and a pair (entropy, index) for each world.

    An entropy is the number, or the numbers, that a NumPy SeedSequence starts from. A world's random streams are seeded
    with its entropy and its index (the first number of a SeedSequence's spawn key).

    seed: one seed, or a tuple with a seed for each world. With one seed, all worlds have the same entropy, and their
        indices differ. With a tuple, each world has its own seed as entropy and the index 0. A world with the seed s in
        a tuple therefore has the streams of the first world of a batch with the single seed s.
    n: number of worlds
    """
    if isinstance(seed, tuple):
        return seed, [(own, 0) for own in seed]
    entropy = np.random.SeedSequence(seed).entropy
    return entropy, [(entropy, i) for i in range(n)]


def _states(generators: Sequence[np.random.Generator]) -> np.ndarray:
    return np.array([json.dumps(rng.bit_generator.state) for rng in generators])


def _set_states(generators: Sequence[np.random.Generator], states: np.ndarray, worlds: np.ndarray) -> None:
    for world in worlds:
        generators[world].bit_generator.state = json.loads(str(states[world]))
