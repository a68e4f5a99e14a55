"""Episode: a recording of one episode of a trained candidate, with its signals, actions and poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

import sim
from evolve.config.run_config import EyeConfig, WorldConfig
from evolve.config.task_card import card_of
from evolve.episodes.episode_scene import EpisodeScene
from evolve.genome.phenotype import Phenotype
from sim.tasks.command import Command
from sim.worlds.ground_plan import GroundPlan

__all__ = ["Episode", "Pictures"]


@dataclass(frozen=True)
class Pictures:
    """Images for display.

    times: time step of each image, (picture,)
    pixels: uint8 sRGB, (picture, y, x, 3)
    """

    times: np.ndarray
    pixels: np.ndarray


@dataclass(frozen=True)
class Episode:
    """Recording of one episode in mode "evaluation" or "test". In the shapes of arrays, t is the time step.

    Row t of the arrays contains the signals at time t, the action that followed, and the reward for this action. Row t
    of the arrays in `beside` belongs to the observation after this action.

    task, candidate_id, seed: name of the task, id of the candidate, and seed of the episode
    phenotype, eye, world: the animal, and the settings of its eyes and of the world
    mode: "evaluation", or "test" if the world has a layout that neither training nor selection uses
    commands: meaning of each element of an action
    action: in [-1, 1], (t, number)
    reward: reward of each action, (t,)
    reward_terms: terms of the reward by name, (t,) each; 0 in steps in which the task did not return the term
    counted: for each term of the reward that reports count, the title of its table row, by name of the term. The row
        shows in how many actions the term was not 0 (see `sim.BatchTask`)
    beside: what the animal observes after each action besides signals and its last action, such as "contact" or "feels"
        (an animal's sense of its own body), by name, (t, number) each
    seconds: duration of one action [s]
    solved: True if the task judges the episode as solved (see `sim.BatchTask.solved`)
    failure: message of the failure that ended the episode; None without a failure
    signals: receptor signals with noise, (t, eye, channel, height, width). The outputs of motion detectors, which the
        animal may also observe, are not included
    perfect_signals: signals of the same receptors behind a perfect lens, without noise, in the same shape; for compound
        eyes, signals of the ommatidia without noise
    wavelengths_nm: wavelengths of the radiance's bands, (band,)
    radiance_frames: time steps at which radiance was recorded, (frame,)
    radiance: radiance of the scene in front of each eye, on a finer grid, (frame, eye, band, y, x), in units of
        `sim.scene.lights`
    azimuths [rad], elevations_deg: viewing direction of each eye relative to the body, site or camera
        that carries the eye, (eye,)
    scene: shapes and poses of bodies, and poses of eyes
    position (t, 2) [m], heading (t,) [rad]: pose of the animal on the ground before each action
    plan: plan of the world from above; None if the task has none
    pictures: images for display; None if not recorded
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
    mode: str = "evaluation"

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
        """Design of the animal's eyes.

        `azimuths` and `elevations_deg` contain the directions of the eyes, and `scene` contains their poses.
        """
        return self.phenotype.eyes(self.eye)

    @property
    def gain(self) -> float:
        """Factor that compensates for the dimming by the pupil: 1 / signal of a white surface.

        For a round pupil of relative aperture a, it is 1/a².
        """
        return 1 / float(self.eyes.eye().white_signal)

    @property
    def objects(self) -> np.ndarray:
        """Positions of the ground plan's objects before each action [m], (t, object, 3); empty if there is no plan."""
        bodies = () if self.plan is None else self.plan.object_bodies
        return self.scene.positions[:, list(bodies)]

    def count(self, term: str) -> int:
        """Return the number of actions in which a reward term was not 0; 0 for a term that does not occur."""
        return int(np.count_nonzero(self.reward_terms[term])) if term in self.reward_terms else 0
