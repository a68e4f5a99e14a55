"""One episode of a trained candidate: its signals, actions and poses, and the signals behind a perfect lens."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

import sim
from evolve.analysis.episode_scene import EpisodeScene
from evolve.config.run_config import EyeConfig, WorldConfig
from evolve.config.task_card import card_of
from evolve.genome.phenotype import Phenotype
from sim.tasks.command import Command
from sim.worlds.ground_plan import GroundPlan

__all__ = ["Episode", "Pictures"]


@dataclass(frozen=True)
class Pictures:
    """Images for display. times (picture,): time steps of the images · pixels (picture, y, x, 3): uint8 sRGB"""

    times: np.ndarray
    pixels: np.ndarray


@dataclass(frozen=True)
class Episode:
    """One evaluation episode, with time along the first axis.

    Row t holds the signals at time t, the action that followed, and the results of this action (rewards and other
    entries of the observation).

    task, candidate_id, seed, phenotype, eye, world: identity of the episode, its animal and its world
    commands: meaning of an action's numbers · action (t, number): in [-1, 1]
    reward (t,), reward_terms name -> (t,): 0 in steps for which the task has not named the term
    counted: title of a count by reward term, see `sim.BatchTask`
    beside: other entries of the observation, name -> (t, number), such as "contact" or "feels"
    seconds: duration of one action · solved: whether the episode counts as solved
    failure: reason for which the episode broke off; None if it did not
    signals: receptor signals, noise included, (t, eye, channel, height, width)
    perfect_signals: the same receptors behind a perfect lens, without noise
    wavelengths_nm: wavelengths of the bands, (band,)
    radiance_frames: time steps at which radiance was recorded, (frame,)
    radiance: radiance of the scene in front of each eye, on a finer grid, (frame, eye, band, y, x)
    azimuths [rad], elevations_deg: viewing direction of each eye in the frame of its body, site or camera, (eye,)
    scene: poses of bodies and eyes
    position (t, 2) [m], heading (t,) [rad]: pose of the animal on the ground before the action
    plan: the world from above, if the task has a ground plan · pictures: images for display, if recorded
    """

    task: str
    candidate_id: int
    seed: int
    phenotype: Phenotype
    eye: EyeConfig
    commands: tuple[Command, ...]
    action: np.ndarray
    reward: np.ndarray
    reward_terms: dict[str, np.ndarray]
    counted: Mapping[str, str]
    beside: dict[str, np.ndarray]
    seconds: float
    solved: bool
    signals: np.ndarray
    perfect_signals: np.ndarray
    wavelengths_nm: np.ndarray
    radiance_frames: np.ndarray
    radiance: np.ndarray
    azimuths: np.ndarray
    elevations_deg: np.ndarray
    scene: EpisodeScene
    position: np.ndarray
    heading: np.ndarray
    plan: GroundPlan | None = None
    pictures: Pictures | None = None
    failure: str | None = None
    world: WorldConfig = field(default_factory=WorldConfig)

    def __len__(self) -> int:
        """Return the number of actions."""
        return len(self.action)

    @property
    def title(self) -> str:
        """Title of the task, for headings."""
        card = card_of(self.task)
        return self.task if card is None else card.title

    @property
    def eyes(self) -> sim.Eyes:
        """The animal's eyes; `azimuths` and `scene` hold their poses."""
        return self.phenotype.eyes(self.eye)

    @property
    def gain(self) -> float:
        """Factor 1/a² that compensates the dimming by a pupil of relative aperture a."""
        return 1 / float(self.eyes.eye().white_signal)

    @property
    def objects(self) -> np.ndarray:
        """Positions of the ground plan's objects before each action [m], (t, object, 3)."""
        bodies = () if self.plan is None else self.plan.object_bodies
        return self.scene.positions[:, list(bodies)]

    def count(self, term: str) -> int:
        """Return the number of actions in which a reward term was not 0."""
        return int(np.count_nonzero(self.reward_terms[term])) if term in self.reward_terms else 0
