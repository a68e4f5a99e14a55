"""Recording of episodes. A candidate plays an episode, and its views are also rendered through a perfect lens."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from evolve.config.checks import ConfigError, quoted
from evolve.config.run_config import RunConfig
from evolve.episodes.episode import Episode, Pictures
from evolve.episodes.episode_scene import EpisodeScene
from evolve.genome.phenotype import Phenotype
from evolve.learning.animal_task import animal_task
from evolve.learning.final_figures import UnfitPolicy, require_fit, require_test_set
from evolve.learning.policy import EyePolicy, TrainingDiverged, load_policy
from evolve.store.candidate import Candidate
from evolve.store.directory import Run, RunError
from evolve.store.policies import require_policy
from optics.numerics.arguments import whole
from sim.envs.prepared_task import PreparedTask
from sim.envs.vec_env import EyesVecEnv
from sim.scene.poses import Poses
from sim.scene.solids import Solid, solids_of
from sim.tasks.simulation import Simulation
from sim.worlds.ground_plan import GroundPlan

__all__ = ["EVERY", "FINE_PIXELS", "Recorder", "damage_named", "record", "trained_policy"]

EVERY, MOST_EVERY = 8, 1_000_000  # default and maximum number of actions between two recordings of radiance
FINE_PIXELS = 60  # smallest number of pixels along the longer side of the radiance images
FINE = {"rays": 16, "areas": 4, "edges": 16}  # samples per receptor or pixel behind a perfect lens
MOST_PICTURES = 128  # maximum number of images for display, at equal intervals of time
MODES = ("evaluation", "test")  # modes of recorded episodes
ELSEWHERE = ("eyes", "previous_action")  # entries of an observation that an episode stores under other names


def record(
    run: Run,
    candidate_id: int | None = None,
    seed: int = 0,
    radiance_every: int = EVERY,
    pictures: bool = False,
    mode: str = "evaluation",
) -> Episode:
    """Record one evaluation episode of a candidate. The same arguments give the same episode, bit for bit.

    candidate_id: id of the candidate; None: the best candidate
    seed: seed of the episode
    radiance_every: number of actions between two recordings of the scene's radiance
    pictures: True to render images for display; for tasks without a ground plan, they are always rendered
    mode: "evaluation", or "test" for the layouts of the test set

    Raises:
        RunError: the candidate does not exist, or its policy is missing or damaged.
        ConfigError: the mode is unknown, the run has no test set, the run was opened without naming its user task, or
            the module of the user task cannot be executed.
        ValueError: `radiance_every` is not a whole number from 1 to 1,000,000, or `seed` is negative.
        RuntimeError: a method of the user task fails at the start of the episode.
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
        OSError: the policy's file cannot be read.
    """
    radiance_every = whole("every", radiance_every, 1, MOST_EVERY)
    if mode not in MODES:
        raise ConfigError(f"mode = {quoted(mode)}: must be one of {', '.join(MODES)}")
    if mode == "test":
        require_test_set(run.config)
    candidate = run.candidate(candidate_id)
    _ = run.config.choice.named_code  # refuses, before any work, a user task that the user has not named
    recorder = Recorder(candidate.phenotype, run.config, trained_policy(run, candidate), radiance_every, pictures, mode)
    with damage_named(run.policy_path(candidate.id)):
        return recorder.play(candidate.id, seed)


def trained_policy(run: Run, candidate: Candidate) -> EyePolicy:
    """Return the trained policy of a candidate.

    Raises:
        RunError: the candidate failed, or its policy is missing or damaged.
        OSError: the policy's file cannot be read, or is not a regular file.
    """
    path = run.policy_path(candidate.id)
    require_policy(candidate, path)
    try:
        return load_policy(path)
    except ValueError as error:
        raise RunError(str(error)) from error


@contextlib.contextmanager
def damage_named(path: Path) -> Iterator[None]:
    """Convert errors of a policy in the body of the `with` statement to errors that name the policy's file.

    Raises:
        RunError: the policy belongs to another animal, or its actions are not finite.
    """
    try:
        yield
    except UnfitPolicy as error:
        raise RunError(f"{path} is another animal's: {error}") from error
    except TrainingDiverged as error:
        raise RunError(f"{path} is damaged: {error}") from error


@dataclass(frozen=True)
class Recorder:
    """Recorder of episodes that an animal plays.

    phenotype, config, policy: the animal, the settings of its run, and its policy
    radiance_every, pictures, mode: see `record`
    """

    phenotype: Phenotype
    config: RunConfig
    policy: EyePolicy
    radiance_every: int = EVERY
    pictures: bool = False
    mode: str = "evaluation"

    def play(self, candidate_id: int, seed: int) -> Episode:
        """Play one episode, and return its recording. The same arguments give the same episode.

        Raises:
            UnfitPolicy: the policy was trained with different eyes.
            TrainingDiverged: the policy's actions are not finite.
            ConfigError: the run was opened without naming its user task, or the module of the user task cannot be
                executed.
            RuntimeError: a method of the user task fails at the start of the episode.
            BackendError: Dr.Jit finds no usable LLVM library or GPU.
        """
        animal, config = self.phenotype, self.config
        prepared = PreparedTask(animal_task(animal, config, self.mode))
        task, mounts = prepared.task, prepared.task.agents()[0].kinds[0].mounts
        with contextlib.closing(prepared.vec_env(1, seed, animal.memory_frames, render_mode="rgb_array")) as worlds:
            require_fit(self.policy, worlds)
            begun = _Beginning.from_env(worlds)
            taken = self.pictures or begun.plan is None
            poses, columns = _play(self.policy, worlds, begun, taken)
            views = self._perfect_views(prepared, worlds.simulation, poses, begun.light)
            scene = EpisodeScene.from_poses(worlds.worlds.model, begun.solids, Poses.joined(*poses), mounts)
            seconds = float(worlds.worlds.seconds)
        return Episode(
            task=config.task,
            candidate_id=candidate_id,
            seed=seed,
            phenotype=animal,
            eye=config.eye,
            world=config.world,
            mode=self.mode,
            commands=task.commands(),
            counted=dict(task.counted),
            seconds=seconds,
            azimuths=task.azimuths(),
            elevations_deg=np.array([mount.elevation_deg for mount in mounts]),
            scene=scene,
            plan=begun.plan,
            **{"position": scene.path[:, :2], "heading": scene.headings, **columns},
            **views,
        )

    def _perfect_views(
        self, prepared: PreparedTask, simulation: Simulation, poses: list[Poses], light: np.ndarray
    ) -> dict[str, Any]:
        """Return, by name, the fields of an episode that are rendered behind a perfect lens.

        The fields are the signals of the animal's receptors, and the radiance on a finer grid than that of the
        receptors. They are rendered for the scenes and the light of the episode. Ommatidia have no counterpart behind a
        perfect lens. For compound eyes, the signals are therefore those of the ommatidia without noise.
        """
        own = self.phenotype.eyes(self.config.eye)
        perfect = own.with_perfect_lens()
        height, width = perfect.resolution
        factor = max(1, -(-FINE_PIXELS // max(height, width)))
        fine = replace(perfect, resolution=(factor * height, factor * width))
        fidelity = replace(prepared.fidelity, rays_per_receptor=FINE[prepared.fidelity.samples])
        receptors, pictures = (
            PreparedTask(animal_task(self.phenotype, self.config, self.mode, eyes), fidelity).renderer(simulation)
            for eyes in (perfect if own.ommatidium is None else own, fine)
        )
        frames, lit = np.arange(0, len(poses), self.radiance_every), light[0, :, None, None, None, None]
        radiance = [np.moveaxis(pictures.receptor_radiance(poses[t]) * lit, 0, 2) for t in frames]
        return {
            "perfect_signals": np.concatenate([receptors.signals(moment, light) for moment in poses]),
            "wavelengths_nm": 1e9 * np.asarray(receptors.eye.spectral_bands.wavelengths),
            "radiance_frames": frames,
            "radiance": np.concatenate(radiance),
        }


@dataclass(frozen=True)
class _Beginning:
    """State at the start of an episode.

    It is stored in advance, because the environment starts the next episode as soon as one ends.

    observation, info: values after the reset
    light: factors by which light is multiplied, (1, band) float32
    solids: visible geoms
    plan: plan of the world from above; None if the task has none
    """

    observation: dict[str, np.ndarray]
    info: Mapping[str, Any]
    light: np.ndarray
    solids: tuple[Solid, ...]
    plan: GroundPlan | None

    @classmethod
    def from_env(cls, worlds: EyesVecEnv) -> _Beginning:
        observation, info = worlds.reset(), worlds.reset_infos[0]
        wavelengths = np.asarray(worlds.renderer.eye.spectral_bands.wavelengths)
        light = worlds.simulation.light(wavelengths)
        solids = solids_of(_model(worlds.worlds))
        plan = worlds.batch_task.ground_plan(np.asarray(info.get("position", (0.0, 0.0))))
        return cls(
            observation, info, np.ones((1, len(wavelengths)), np.float32) if light is None else light, solids, plan
        )


def _model(physics: Any) -> mujoco.MjModel:
    """Return the MuJoCo model of the only simulated world, with all values drawn at the start of the episode."""
    model: mujoco.MjModel = physics.datas[0].model if hasattr(physics, "datas") else physics.model
    return model


def _play(
    policy: EyePolicy, worlds: EyesVecEnv, begun: _Beginning, pictures: bool
) -> tuple[list[Poses], dict[str, Any]]:
    """Play one episode, and return the poses before each action and some fields of `Episode`, by name.

    These are the fields that follow from the actions, observations and rewards of the episode.

    pictures: True to render images for display
    """
    poses, rows, taken = list[Poses](), list[tuple[Any, ...]](), list[np.ndarray]()
    observation, infos, done, solved = begun.observation, [begun.info], False, None
    channels = worlds.renderer.eye.channels
    every = max(1, -(-worlds.simulation.episode_steps // MOST_PICTURES))
    while not done:
        if pictures and len(rows) % every == 0:
            taken.append(worlds.get_images()[0])
        poses.append(worlds.simulation.poses())
        seen = observation["eyes"][0, -1][:, :channels]
        action = policy.predict(observation, deterministic=True)[0]
        observation, reward, dones, (info,) = worlds.step(action)
        done, solved = bool(dones[0]), worlds.batch_task.solved(solved, info)
        known = info["terminal_observation"] if done else {name: array[0] for name, array in observation.items()}
        beside = {name: array for name, array in known.items() if name not in ELSEWHERE}
        rows.append((np.clip(action[0], -1, 1), reward[0], info["reward_terms"], seen, beside))
        infos.append(info)
    action, reward, terms, signals, known_after = zip(*rows, strict=True)
    names = list(dict.fromkeys(name for of_step in terms for name in of_step))
    return poses, {
        "action": np.array(action),
        "reward": np.array(reward),
        "reward_terms": {name: np.array([of_step.get(name, 0.0) for of_step in terms]) for name in names},
        "signals": np.array(signals),
        "beside": {name: np.array([of_step[name] for of_step in known_after]) for name in known_after[0]},
        "pictures": Pictures(np.arange(0, len(rows), every), np.array(taken)) if pictures else None,
        "solved": bool(solved),
        "failure": infos[-1].get("failure"),
        **_on_ground(infos[:-1]),
    }


def _on_ground(infos: list[Mapping[str, Any]]) -> dict[str, np.ndarray]:
    """Return the animal's "position" [m] and "heading" [rad] before each action; {} if `infos` lack one of the two.

    These values are exact, in contrast to headings that are computed from rotation matrices. The arrays have the shapes
    (action, 2) and (action,).

    infos: the task's `info` before each action
    """
    if not all(np.shape(info.get("position", ())) == (2,) and "heading" in info for info in infos):
        return {}
    return {name: np.array([info[name] for info in infos]) for name in ("position", "heading")}
