"""One episode in a task of somebody's own, recorded: what was seen and done, and pictures of it for people."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

import sim
from evolve.analysis.filmed_scene import FilmedScene
from evolve.config.run_config import EyeConfig, RunConfig
from evolve.config.task_card import card_of
from evolve.genome.phenotype import Phenotype
from evolve.learning.animal_task import animal_task
from evolve.learning.policy import EyePolicy
from sim.envs.prepared_task import PreparedTask
from sim.envs.vec_env import EyesVecEnv
from sim.scene.poses import Poses
from sim.scene.solids import solids_of
from sim.tasks.simulation import Simulation

__all__ = ["FilmedEpisode", "film", "moments"]

FINE_PIXELS = 60  # least pixels along the longer side of the radiance pictures
RAYS = 16  # per receptor and pixel, of what nobody has to be quick with
MOST_PICTURES = 128  # for people: they are kept at even times

Lit = Callable[[np.ndarray], np.ndarray]  # wavelengths [m] -> what lights were multiplied by, (1, band)


@dataclass(frozen=True)
class FilmedEpisode:
    """One evaluation episode. Time runs along the first axis: at time t the eyes saw, then the animal acted, and
    `reward` and `reward_terms` are what that action led to.

    task, candidate_id, seed, phenotype, eye: which episode of whom
    action (t, number)        in [-1, 1]
    reward (t,), reward_terms name -> (t,)   after it; 0 where the task has not named the term
    signals: what the receptors reported, noise included, (t, eye, channel, height, width)
    perfect_signals: the same receptors behind a perfect lens, without noise
    wavelengths_nm: of the bands, (band,)
    radiance_frames: times t at which radiance was kept, (frame,)
    radiance: of the scene before each eye, on a finer grid, (frame, eye, band, y, x)
    picture_times: times t of which there are pictures, (picture,) · pictures (picture, y, x, 3) uint8 sRGB
    scene: where everything was
    azimuths_deg, elevations_deg: where each eye looks in the frame of what it is on, (eye,)
    seconds: that one action lasts · solved: whether what is to be done was done at the end
    failure: what the task failed with, if it did
    """

    task: str
    candidate_id: int
    seed: int
    phenotype: Phenotype
    eye: EyeConfig
    action: np.ndarray
    reward: np.ndarray
    reward_terms: dict[str, np.ndarray]
    signals: np.ndarray
    perfect_signals: np.ndarray
    wavelengths_nm: np.ndarray
    radiance_frames: np.ndarray
    radiance: np.ndarray
    picture_times: np.ndarray
    pictures: np.ndarray
    scene: FilmedScene
    azimuths_deg: np.ndarray
    elevations_deg: np.ndarray
    seconds: float
    solved: bool
    failure: str | None = None

    def __len__(self) -> int:
        """Actions taken."""
        return len(self.action)

    @property
    def title(self) -> str:
        """Of the task, for headings."""
        card = card_of(self.task)
        return self.task if card is None else card.title

    @property
    def eyes(self) -> sim.Eyes:
        """The eyes that saw it, as if they were on rhabdom's own agent."""
        return self.phenotype.eyes(self.eye)


def film(
    phenotype: Phenotype, config: RunConfig, policy: EyePolicy, candidate_id: int, seed: int, radiance_every: int
) -> FilmedEpisode:
    """Let an animal play one episode; same arguments, same episode."""
    task = PreparedTask(animal_task(phenotype, config))
    (kind,) = task.task.agents()[0].kinds
    with contextlib.closing(task.vec_env(1, seed, phenotype.memory_frames, render_mode="rgb_array")) as worlds:
        first = worlds.reset()
        model = worlds.worlds.model
        solids = solids_of(worlds.worlds.datas[0].model)  # now: the next episode's may differ, and begins by itself
        poses, columns, lit = _play(policy, worlds, first)
        views = _perfect_views(worlds.simulation, task, poses, radiance_every, lit)
        everywhere = Poses.joined(*poses)
        eyes = worlds.renderer.eye_frames(everywhere)
        scene = FilmedScene.of(model, solids, everywhere, kind.mounts[0], eyes)
        seconds = worlds.worlds.seconds
    return FilmedEpisode(
        task=config.task,
        candidate_id=candidate_id,
        seed=seed,
        phenotype=phenotype,
        eye=config.eye,
        scene=scene,
        azimuths_deg=np.array([mount.azimuth_deg for mount in kind.mounts]),
        elevations_deg=np.array([mount.elevation_deg for mount in kind.mounts]),
        seconds=seconds,
        **columns,
        **views,
    )


def moments(task: PreparedTask, n: int, seed: int) -> tuple[mujoco.MjModel, dict[str, Any], Poses]:
    """The model; what a `sim.ModelRenderer` must know of spectra and of geoms that differ; and where everything is at
    the beginnings of n episodes."""
    with contextlib.closing(Simulation(task.task, n, seed)) as worlds:
        worlds.reset()
        how = {"spectra": task.task.spectra, "varied": worlds.physics.varied}
        return worlds.physics.model, how, worlds.poses()


def _play(
    policy: EyePolicy, worlds: EyesVecEnv, observation: dict[str, np.ndarray]
) -> tuple[list[Poses], dict[str, Any], Lit]:
    """Where everything was before each action, the columns that playing fills, and the episode's light; the episode
    has just begun with this observation."""
    poses: list[Poses] = []
    rows: list[tuple[Any, ...]] = []
    pictures: list[np.ndarray] = []
    info, done = dict[str, Any](), False
    simulation = worlds.simulation
    variation, varied = simulation.variation, {name: v.copy() for name, v in simulation.varied.items()}
    every = max(1, -(-simulation.episode_steps // MOST_PICTURES))
    while not done:
        if len(rows) % every == 0:
            pictures.append(worlds.get_images()[0])
        poses.append(simulation.poses())
        seen = observation["eyes"][0, -1]
        action = policy.predict(observation, deterministic=True)[0]
        observation, reward, dones, infos = worlds.step(action)
        done, info = bool(dones[0]), infos[0]
        rows.append((np.clip(action[0], -1, 1), reward[0], info["reward_terms"], seen))
    action, reward, terms, signals = zip(*rows, strict=True)
    names = list(dict.fromkeys(name for of_step in terms for name in of_step))
    columns = {
        "action": np.array(action),
        "reward": np.array(reward),
        "reward_terms": {name: np.array([of_step.get(name, 0.0) for of_step in terms]) for name in names},
        "signals": np.array(signals),
        "picture_times": np.arange(0, len(rows), every),
        "pictures": np.array(pictures),
        "solved": bool(info["is_success"]),
        "failure": info.get("failure"),
    }

    def lit(wavelengths: np.ndarray) -> np.ndarray:
        found = None if variation is None else variation.light(varied, wavelengths)
        return np.ones((1, len(wavelengths))) if found is None else found

    return poses, columns, lit


def _perfect_views(worlds: Simulation, task: PreparedTask, poses: list[Poses], every: int, lit: Lit) -> dict[str, Any]:
    """The same scenes through a perfect lens: by the same receptors, and as radiance on a finer grid."""
    (kind,) = worlds.agents[0].kinds
    perfect = replace(kind.eye, pupil=None, waveguide=None)
    height, width = perfect.resolution
    factor = max(1, -(-FINE_PIXELS // max(height, width)))
    fine = replace(perfect, resolution=(factor * height, factor * width))
    fidelity = replace(task.fidelity, rays_per_receptor=RAYS)
    how: dict[str, Any] = {"spectra": worlds.task.spectra, "varied": worlds.physics.varied}
    receptors, pictures = (
        sim.ModelRenderer(worlds.physics.model, eye, kind.mounts, 1, fidelity, **how) for eye in (perfect, fine)
    )
    wavelengths = np.asarray(receptors.eye.spectral_bands.wavelengths)
    frames, light = np.arange(0, len(poses), every), lit(wavelengths)
    radiance = [
        np.moveaxis(pictures.receptor_radiance(poses[t]) * light[0, :, None, None, None, None], 0, 2) for t in frames
    ]
    return {
        "perfect_signals": np.concatenate([receptors.signals(moment, light) for moment in poses]),
        "wavelengths_nm": 1e9 * wavelengths,
        "radiance_frames": frames,
        "radiance": np.concatenate(radiance),
    }
