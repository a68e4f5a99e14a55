"""One episode of a trained candidate, recorded: what it saw, what it did, and what a perfect eye would have seen."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import sim
from evolve.analysis.filmed_episode import FilmedEpisode, film
from evolve.config.formats import task_then
from evolve.config.run_config import EyeConfig, WorldConfig
from evolve.config.task_card import card_of
from evolve.genome.phenotype import Phenotype
from evolve.genome.plain_values import parsed
from evolve.learning.policy import EyePolicy, TrainingDiverged, load_policy
from evolve.store import regular_files
from evolve.store.atomic_files import write_whole
from evolve.store.candidate import Candidate
from evolve.store.directory import Run, RunError
from evolve.store.policies import require_policy
from sim.worlds.state import WorldState, concatenate

__all__ = ["Episode", "record"]

FINE_PIXELS = 60  # least pixels along the longer side of the radiance pictures
MOST_BYTES = 2**31  # of an episode; those of 256 steps take some megabytes
FINE = {"rays": 16, "areas": 4}  # samples per pixel of them


@dataclass(frozen=True)
class Episode:
    """One evaluation episode. Time runs along the first axis: at time t the eyes saw, then the agent acted,
    and `reward`, `reward_terms` and `contact` are what that action led to.

    task, candidate_id, seed, phenotype, eye, world: which episode of whom, and where
    position (t, 2) [m], heading (t,) [rad], objects (t, object, 3) [m]   before the action
    action (t, 2)             as Gymnasium's action in [-1, 1]
    reward (t,), reward_terms name -> (t,), contact (t,) bool   after it
    adversary_first (t,) bool   whether it reached an adversary, and before any goal; None of an earlier version
    signals: what the receptors reported, noise included, (t, eye, channel, height, width)
    perfect_signals: the same receptors behind a perfect lens, without noise
    wavelengths_nm: of the bands, (band,)
    radiance_frames: times t at which radiance was kept, (frame,)
    radiance: of the scene before each eye, on a finer grid, (frame, eye, band, y, x)
    """

    task: str
    candidate_id: int
    seed: int
    phenotype: Phenotype
    eye: EyeConfig
    position: np.ndarray
    heading: np.ndarray
    objects: np.ndarray
    action: np.ndarray
    reward: np.ndarray
    reward_terms: dict[str, np.ndarray]
    contact: np.ndarray
    signals: np.ndarray
    perfect_signals: np.ndarray
    wavelengths_nm: np.ndarray
    radiance_frames: np.ndarray
    radiance: np.ndarray
    world: WorldConfig = field(default_factory=WorldConfig)
    adversary_first: np.ndarray | None = None

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
        """The eyes that saw it."""
        return self.phenotype.eyes(self.eye)

    def save(self, path: Path | str) -> None:
        """Write as npz, whole or not at all: an array per array, and the rest as JSON."""
        arrays = {name: value for name, value in vars(self).items() if isinstance(value, np.ndarray)}
        rest = {
            "task": self.task,
            "candidate_id": self.candidate_id,
            "seed": self.seed,
            "phenotype": self.phenotype.to_json(),
            "eye": asdict(self.eye),
            "world": asdict(self.world),
            "terms": list(self.reward_terms),
        }
        terms = {f"term_{name}": term for name, term in self.reward_terms.items()}
        content = io.BytesIO()
        columns: dict[str, Any] = {**arrays, **terms, "rest": np.array(json.dumps(rest))}
        np.savez_compressed(content, **columns)  # without allow_pickle: NumPy 2.0 would take it for an array
        write_whole(Path(path), content.getvalue())

    @classmethod
    def load(cls, path: Path | str) -> Episode:
        """Inverse of `save`; Nothing in it is executed.

        Raises:
            ValueError: one line, naming the file, if it holds no episode.
        """
        try:
            arrays = _arrays(path)
            rest = parsed(str(arrays.pop("rest")))
            rest |= {"phenotype": Phenotype.from_json(rest["phenotype"]), "eye": EyeConfig(**rest["eye"])}
            if "course" not in rest.setdefault("world", {}):
                rest["task"] = task_then(rest["task"])
            rest["world"] = WorldConfig(**rest["world"])
            terms = {name: arrays.pop(f"term_{name}") for name in rest.pop("terms")}
            return cls(**rest, reward_terms=terms, **arrays)
        except (OSError, EOFError, KeyError, TypeError, ValueError, AttributeError, zipfile.BadZipFile) as error:
            raise ValueError(f"{path} holds no episode: {error}") from error


def _arrays(path: Path | str) -> dict[str, Any]:
    """What an archive holds, unless it is no file, or would unpack to more than an episode ever takes."""
    with regular_files.opened(Path(path)) as content:
        with zipfile.ZipFile(content) as archive:
            size = sum(member.file_size for member in archive.infolist())
        if size > MOST_BYTES:
            raise ValueError(f"it would unpack to {size:,} bytes: must be at most {MOST_BYTES:,}")
        content.seek(0)
        with np.load(content, allow_pickle=False) as file:
            return dict(file)


def record(
    run: Run, candidate_id: int | None = None, seed: int = 0, radiance_every: int = 8
) -> Episode | FilmedEpisode:
    """Let a candidate (default: the best) play one evaluation episode; same arguments, same episode, bit for bit. In a
    task of somebody's own it is filmed.

    radiance_every: actions between two pictures of the scene's radiance

    Raises:
        RunError: there is no such candidate, or its policy is missing or no policy.
        ConfigError: the task is somebody's own, and has not been named.
    """
    candidate = run.candidate(candidate_id)
    require_policy(candidate, run.policy_path(candidate.id))
    own = run.config.choice.named_code
    try:
        policy = load_policy(run.policy_path(candidate.id))
    except ValueError as error:
        raise RunError(str(error)) from error
    if own is not None:
        return _filmed(run, candidate, policy, seed, radiance_every)
    eyes = candidate.phenotype.eyes(run.config.eye)
    worlds = sim.make_vec_env(
        run.config.task,
        eyes,
        1,
        seed,
        memory=candidate.phenotype.memory_frames,
        mode="evaluation",
        rays_per_receptor=run.config.eye.rays_per_receptor,
        vary=run.config.world.vary,
        **run.config.world.evaluation,
    )
    try:
        _require_fit(policy, worlds, run.policy_path(candidate.id))
        states, columns, light = _play(policy, worlds)
        views = _perfect_views(worlds, eyes, states, radiance_every, light)
    except TrainingDiverged as error:
        raise RunError(f"{run.policy_path(candidate.id)} is damaged: {error}") from error
    finally:
        worlds.close()
    return Episode(
        task=run.config.task,
        candidate_id=candidate.id,
        seed=seed,
        phenotype=candidate.phenotype,
        eye=run.config.eye,
        world=run.config.world,
        position=states.position,
        heading=states.heading,
        objects=states.objects,
        **columns,
        **views,
    )


def _filmed(run: Run, candidate: Candidate, policy: EyePolicy, seed: int, radiance_every: int) -> FilmedEpisode:
    animal, space = candidate.phenotype, policy.observation_space["eyes"].shape
    if space[:2] != (animal.memory_frames, animal.n_eyes) or space[3:] != animal.resolution:
        raise RunError(f"{run.policy_path(candidate.id)} is another animal's: it sees {space}")
    try:
        return film(animal, run.config, policy, candidate.id, seed, radiance_every)
    except TrainingDiverged as error:
        raise RunError(f"{run.policy_path(candidate.id)} is damaged: {error}") from error


def _require_fit(policy: EyePolicy, worlds: Any, path: Path) -> None:
    own, here = (space["eyes"].shape for space in (policy.observation_space, worlds.observation_space))
    if own != here:
        raise RunError(f"{path} is another animal's: it sees {own}, this one {here} (memory, eye, channel, y, x)")


def _play(policy: EyePolicy, worlds: Any) -> tuple[WorldState, dict[str, Any], float]:
    """The single world's states, one after the other as a batch, the Episode's columns that playing fills, and how much
    light there is."""
    states, rows, done = [], [], False
    observation = worlds.reset()
    light = float(worlds.reset_infos[0].get("varied", {}).get("light", 1.0))
    while not done:
        states.append(worlds.state)
        seen = observation["eyes"][0, -1]
        action = policy.predict(observation, deterministic=True)[0]
        observation, reward, dones, infos = worlds.step(action)
        done = bool(dones[0])
        felt = infos[0]["terminal_observation"]["contact"] if done else observation["contact"][0]
        first = bool(infos[0].get("adversary_first"))
        rows.append((action[0], reward[0], infos[0]["reward_terms"], felt[0] > 0, seen, first))
    action, reward, terms, contact, signals, adversary_first = zip(*rows, strict=True)
    columns = {
        "action": np.array(action),
        "reward": np.array(reward),
        "reward_terms": {name: np.array([of_step[name] for of_step in terms]) for name in terms[0]},
        "contact": np.array(contact),
        "signals": np.array(signals),
        "adversary_first": np.array(adversary_first),
    }
    return concatenate(states), columns, light


def _perfect_views(worlds: Any, eyes: sim.Eyes, states: WorldState, every: int, light: float = 1.0) -> dict[str, Any]:
    """The same scenes in the same light through a perfect lens: by the same receptors, and as radiance on a finer
    grid."""
    world, seen = worlds.worlds.world, worlds.renderer.fidelity
    perfect = replace(eyes, optics=None, waveguide=None)
    factor = max(1, -(-FINE_PIXELS // max(eyes.resolution)))
    fine = replace(perfect, resolution=(factor * eyes.resolution[0], factor * eyes.resolution[1]))
    fidelity = sim.Fidelity(FINE[seen.samples], eyes.bands, light=seen.light, samples=seen.samples)
    receptors, pictures = (sim.BatchedRenderer(world, e, 1, fidelity) for e in (perfect, fine))
    scenes = [states.take(np.array([t])) for t in range(states.n)]
    frames = np.arange(0, states.n, every)
    radiance = [light * np.moveaxis(pictures.receptor_radiance(scenes[t]), 0, 2) for t in frames]
    return {
        "perfect_signals": light * np.concatenate([receptors.signals(scene) for scene in scenes]),
        "wavelengths_nm": 1e9 * np.asarray(pictures.bands.wavelengths),
        "radiance_frames": frames,
        "radiance": np.concatenate(radiance),
    }
