"""Renderers of every agent's eyes, for the worlds of a simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.eyes.mounts import Mount
from sim.render.batched_renderer import BatchedRenderer
from sim.render.fidelity import Fidelity
from sim.render.model_renderer import ModelRenderer
from sim.render.pending_frame import PendingFrame
from sim.render.prepared_scene import PreparedScene
from sim.render.receptor_noise import FEW
from sim.scene.poses import Poses
from sim.tasks.batch_task import Agent
from sim.tasks.built_in import AgentTask
from sim.tasks.eye_kinds import EYES, EyeKind
from sim.tasks.simulation import Simulation
from sim.tracing import lighting
from sim.worlds.state import WorldState

__all__ = ["AgentRenderers", "Renderer", "renderers_for", "scenes_for"]

Renderer = Any  # until all eyes have one renderer


@dataclass(frozen=True)
class AgentRenderers:
    """Of one agent. eyes: by kind · auxiliary: of depth, ids and flow, in the same order, where these are wanted"""

    eyes: Mapping[str, Renderer]
    auxiliary: tuple[ModelRenderer, ...] = ()


def scenes_for(task: AgentTask) -> dict[str, PreparedScene]:
    """The task's world made ready for each kind of its eyes."""
    kinds = task.eyes if isinstance(task.eyes, Mapping) else {EYES: task.eyes}
    return {name: PreparedScene(task.world, eyes) for name, eyes in kinds.items() if eyes is not None}


def renderers_for(
    simulation: Simulation,
    agents: Sequence[Agent],
    fidelities: Sequence[Mapping[str, Fidelity] | None],
    scenes: Mapping[str, PreparedScene] | None,
) -> list[AgentRenderers | None]:
    """Of all agents; None for those that look at nothing.

    agents: of the simulation, maybe with other eyes
    fidelities: of every agent's eyes by kind · scenes: of a built-in layout by kind of eyes; None: of other models
    """
    return [
        None if of is None else _of_agent(simulation, agent, of, scenes)
        for agent, of in zip(agents, fidelities, strict=True)
    ]


def _of_agent(
    simulation: Simulation, agent: Agent, fidelities: Mapping[str, Fidelity], scenes: Mapping[str, PreparedScene] | None
) -> AgentRenderers:
    if scenes is None:
        eyes: dict[str, Renderer] = {
            kind.name: _OnModel(simulation, kind, fidelities[kind.name]) for kind in agent.kinds
        }
    else:
        eyes = {
            kind.name: _InWorld(scenes[kind.name], simulation.n, kind, fidelities[kind.name]) for kind in agent.kinds
        }
    auxiliary = [_labels(simulation, eyes[kind.name], kind) for kind in agent.kinds] if agent.auxiliary else []
    return AgentRenderers(eyes, tuple(auxiliary))


def _labels(simulation: Simulation, renderer: Renderer, kind: EyeKind) -> ModelRenderer:
    if isinstance(renderer, ModelRenderer):
        return renderer
    import warnings

    from sim.scene.mirror import MirrorWarning

    task, eye = simulation.task, renderer.eye
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MirrorWarning)  # of light, which is not asked for
        return ModelRenderer(task.model, eye, kind.mounts, simulation.n, Fidelity(1, eye.bands), spectra=task.spectra)


class _OnModel(ModelRenderer):
    def __init__(self, simulation: Simulation, kind: EyeKind, fidelity: Fidelity) -> None:
        model, spectra, varied = simulation.physics.model, simulation.task.spectra, simulation.physics.varied
        super().__init__(model, kind.eye, kind.mounts, simulation.n, fidelity, spectra=spectra, varied=varied)

    def begin_some(self, poses: Poses, worlds: np.ndarray, light: np.ndarray | None = None) -> PendingFrame:
        return self.begin(poses, light).then(lambda seen: seen[worlds])


class _InWorld:
    def __init__(self, scene: PreparedScene, n: int, kind: EyeKind, fidelity: Fidelity) -> None:
        self.inner = BatchedRenderer.of(scene, n, fidelity)
        self.mounts: tuple[Mount, ...] = kind.mounts
        self.only_directional = True
        self._few: BatchedRenderer | None = None
        objects = [int(scene.world.model.body(name).id) for name in scene.world.objects]
        self._agent, self._objects = int(scene.world.model.body("agent").id), objects

    def __getattr__(self, name: str) -> Any:
        return getattr(self.inner, name)

    def begin(self, poses: Any, light: np.ndarray | None = None) -> PendingFrame:
        return self._lit(self.inner, self._state(poses), light)

    def signals(self, poses: Any, light: np.ndarray | None = None) -> np.ndarray:
        return self.begin(poses, light).wait()

    def receptor_radiance(self, poses: Any) -> np.ndarray:
        return self.inner.receptor_radiance(self._state(poses))

    def begin_some(self, poses: Any, worlds: np.ndarray, light: np.ndarray | None = None) -> PendingFrame:
        state = self._state(poses)
        if len(worlds) <= FEW < state.n:
            self._few = self._few or self.inner.resized(FEW)
            padded = np.resize(worlds, FEW)
            few = None if light is None else light[padded]
            return self._lit(self._few, state.take(padded), few).then(lambda signals: signals[: len(worlds)])
        return self._lit(self.inner, state, light).then(lambda signals: signals[worlds])

    def brightest_in(self, light: np.ndarray) -> float:
        mixing = self.inner.eye.throughput * self.inner.bands.weights
        white = lighting.white_radiance(self.inner._static.scene, self.inner.bands.wavelengths)
        return float((mixing @ (light * white)).max())

    def eye_frames(self, poses: Poses) -> tuple[np.ndarray, np.ndarray]:
        body = [poses.frames("body", self._agent) for _ in self.mounts]
        local = [mount.local("body") for mount in self.mounts]
        places = [origin + turned @ at for (origin, turned), (at, _) in zip(body, local, strict=True)]
        frames = [turned @ frame for (_, turned), (_, frame) in zip(body, local, strict=True)]
        return np.stack(places, axis=1), np.stack(frames, axis=1)

    @staticmethod
    def _lit(renderer: BatchedRenderer, state: WorldState, light: np.ndarray | None) -> PendingFrame:
        if light is None or (light == light[:, :1]).all():
            level = 1.0 if light is None else light[:, 0][:, None, None, None, None]
            seen = renderer.begin(state)
            return seen if light is None else seen.then(lambda signals: signals * level)
        mixing = renderer.eye.aperture_throughput * renderer.bands.weights

        def filtered(sums: np.ndarray) -> np.ndarray:
            layers = sums.reshape(renderer.sensor.depth.count, len(renderer.tracer.basis), -1)
            planes = np.einsum("lkn,kb->lbn", layers, renderer.tracer.basis.astype(np.float32))
            views = renderer.n_envs * renderer.eyes.n_eyes
            planes = planes.reshape(-1, views, planes.shape[-1] // views)
            radiance = renderer.sensor.receptor_radiance(planes)
            radiance = radiance.reshape(-1, renderer.n_envs, renderer.eyes.n_eyes, *renderer.eye.resolution)
            signals = np.einsum("cb,nb,bnehw->nechw", mixing, light, radiance).astype(np.float32)
            mosaic = renderer.eye.mosaic
            return signals if mosaic is None else np.take_along_axis(signals, mosaic[None, None, None], axis=2)

        return renderer._launched(renderer._sums, state).then(filtered)

    def _state(self, poses: Any) -> WorldState:
        state: WorldState = getattr(poses, "state", poses)
        return state
