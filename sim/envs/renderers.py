"""Renderers of every agent's eyes, for the worlds of a simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from optics.elements.turbid_medium import medium_of
from sim.render.batched_renderer import BatchedRenderer
from sim.render.eye_renderer import EyeRenderer
from sim.render.fidelity import AREAS, Fidelity
from sim.render.labels import Labels
from sim.render.prepared_scene import PreparedScene
from sim.render.world_scene import WorldScene
from sim.tasks.batch_task import Agent
from sim.tasks.built_in import AgentTask
from sim.tasks.eye_kinds import EYES, EyeKind, named_in_errors
from sim.tasks.simulation import Simulation

__all__ = ["AgentRenderers", "renderers_for", "scenes_for"]


@dataclass(frozen=True)
class AgentRenderers:
    """Renderers of one agent's eyes.

    eyes: renderer of each kind of eyes, by name of the kind
    auxiliary: renderers of depth, ids and flow for the same kinds of eyes, in the same order; empty if the agent's
        observations contain none of these quantities
    """

    eyes: Mapping[str, EyeRenderer]
    auxiliary: tuple[Labels, ...] = ()


def scenes_for(task: AgentTask) -> dict[str, WorldScene]:
    """Return scenes of the task's world, prepared for rendering: {name of a kind of the agent's eyes: its scene}."""
    kinds = task.eyes if isinstance(task.eyes, Mapping) else {EYES: task.eyes}
    return {name: WorldScene(task.world, eyes) for name, eyes in kinds.items() if eyes is not None}


def renderers_for(
    simulation: Simulation,
    agents: Sequence[Agent],
    fidelities: Sequence[Mapping[str, Fidelity] | None],
    scenes: Mapping[str, WorldScene] | None,
) -> list[AgentRenderers | None]:
    """Return the renderers of all agents; None for agents whose eyes are not used.

    agents: agents of the simulation; their eyes may differ from those of `simulation.agents`
    fidelities: for each agent, a dictionary from the name of each kind of its eyes to the accuracy with which the world
        is rendered for them (see `Fidelity`); None instead of the dictionary if the agent's eyes are not used
    scenes: scenes of a built-in layout, by kind of eyes; None for other models
    """
    return [
        None if of is None else _of_agent(simulation, agent, of, scenes)
        for agent, of in zip(agents, fidelities, strict=True)
    ]


def _of_agent(
    simulation: Simulation, agent: Agent, fidelities: Mapping[str, Fidelity], scenes: Mapping[str, WorldScene] | None
) -> AgentRenderers:
    eyes: dict[str, EyeRenderer] = {}
    for kind in agent.kinds:
        fidelity = fidelities[kind.name]
        if scenes is None:
            with named_in_errors(agent.name):
                renderer = EyeRenderer(_scene_of_model(simulation, kind, fidelity), simulation.n, fidelity)
        else:
            renderer = BatchedRenderer.from_scene(scenes[kind.name], simulation.n, fidelity)
        eyes[kind.name] = renderer
    with named_in_errors(agent.name):
        return AgentRenderers(eyes, tuple(renderer.labels for renderer in eyes.values()) if agent.auxiliary else ())


def _scene_of_model(simulation: Simulation, kind: EyeKind, fidelity: Fidelity) -> PreparedScene:
    """Return the simulation's model as a scene for one kind of eyes.

    If light is sampled along rays, Mitsuba traces all of them. If light is sampled over areas of the visual field,
    closed forms may replace ray tracing.
    """
    task, physics = simulation.task, simulation.physics
    return PreparedScene(
        physics.model,
        replace(kind.eye, bands=fidelity.bands),
        kind.mounts,
        spectra=task.spectra,
        varied=physics.varied,
        medium=medium_of("medium", task.medium),
        tracer="auto" if fidelity.samples == AREAS else "mitsuba",
    )
