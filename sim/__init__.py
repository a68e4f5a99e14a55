"""rhabdom.sim: MuJoCo worlds, mirrored as spectral Mitsuba scenes and rendered for the eyes of many agents at once.

Eyes, build_world, World            the eyes of an agent, and the built-in worlds
Course, LayoutFamily                a user-defined course, or a family of random courses, for navigation
TASKS                               names of the built-in tasks
mirror, Mirror, MirrorWarning       conversion of any MuJoCo model to a Mitsuba scene
BatchedRenderer                     renderer of all eyes of all worlds in one wavefront
choose_fidelity, Fidelity           rendering accuracy, chosen to match the receptors' noise
FidelityWarning                     warning that no level of fidelity is accurate enough
ReferenceRenderer                   slow reference: Mitsuba's integrators and the convolution in `optics`
ModelRenderer, Poses                renderer of eyes on any MuJoCo model, and poses of the model in a batch of worlds
Mount, fan, ring, both_sides        positions and directions of eyes on a model
CompoundEye                         ommatidia with any viewing directions
hexagonal_patch, whole_head, hexagonal_rows   viewing directions for a CompoundEye
choose_model_fidelity               rendering accuracy for eyes on a model
Task                                a user task for a robot with eyes, written for one world at a time
BatchTask                           a user task written for arrays of all worlds, which runs faster
check_batch_task                    test whether a batch task follows the protocol of BatchTask
Outcome, RewardTerms                return value of a batch task's `judge`, and the reward terms that it contains
Physics                             protocol of the physics of a batch of worlds
ArrayWorlds, SlidingAgents          two implementations of Physics: for any MuJoCo model, and for the built-in agent
Encounter, Frozen                   several animals in one world that see each other, and an animal that does not learn
make_parallel_env                   PettingZoo environment of an Encounter
make_vec_env, make_env              environments of many worlds in one batch, or of a single world
                                    (or gymnasium.make("rhabdom/Detection-v0"), "rhabdom/Maze-v0" ...)
set_threads                         number of threads of Dr.Jit, torch, OpenMP and BLAS
register_task                       registration of a user task under a Gymnasium id
View, write_exr, read_exr           images of eyes in EXR files
read_photograph, see_photograph     a photograph, and its image in an animal's eye as a ReceptorMosaic
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

import rhabdom  # noqa: F401 (makes `import optics` find rhabdom's package if another project has installed one)
from sim.envs.registration import register as register_environments
from sim.worlds import catalog

if TYPE_CHECKING:
    from sim.envs.assembly import make_parallel_env, make_vec_env
    from sim.envs.batch_task_checker import check_batch_task
    from sim.envs.env import make_env
    from sim.envs.registration import register_task
    from sim.envs.threads import set_threads
    from sim.exr.files import read_exr, write_exr
    from sim.exr.view import View
    from sim.eyes.compound_eye import CompoundEye
    from sim.eyes.eyes import Eyes
    from sim.eyes.hexagonal_rows import hexagonal_rows
    from sim.eyes.mounts import Mount, both_sides, fan, ring
    from sim.eyes.viewing_directions import hexagonal_patch, whole_head
    from sim.physics.array_worlds import ArrayWorlds
    from sim.physics.physics import Physics
    from sim.physics.sliding_agents import SlidingAgents
    from sim.pictures.photograph import read_photograph, see_photograph
    from sim.pictures.receptor_mosaic import ReceptorMosaic
    from sim.render.batched_renderer import BatchedRenderer
    from sim.render.fidelity import Fidelity
    from sim.render.fidelity_choice import FidelityWarning
    from sim.render.model_fidelity import choose_model_fidelity
    from sim.render.model_renderer import ModelRenderer
    from sim.render.reference_renderer import ReferenceRenderer
    from sim.render.world_fidelity import choose_fidelity
    from sim.scene.mirror import Mirror, MirrorWarning, mirror
    from sim.scene.poses import Poses
    from sim.tasks.batch_task import BatchTask
    from sim.tasks.encounter import Encounter, Frozen
    from sim.tasks.outcome import Outcome, RewardTerms
    from sim.tasks.task import Task
    from sim.worlds.course import Course
    from sim.worlds.layout_family import LayoutFamily
    from sim.worlds.world import World, build_world

_HOME = {
    "CompoundEye": "sim.eyes.compound_eye",
    "hexagonal_patch": "sim.eyes.viewing_directions",
    "hexagonal_rows": "sim.eyes.hexagonal_rows",
    "whole_head": "sim.eyes.viewing_directions",
    "Eyes": "sim.eyes.eyes",
    "Course": "sim.worlds.course",
    "LayoutFamily": "sim.worlds.layout_family",
    "World": "sim.worlds.world",
    "build_world": "sim.worlds.world",
    "Mirror": "sim.scene.mirror",
    "MirrorWarning": "sim.scene.mirror",
    "mirror": "sim.scene.mirror",
    "BatchedRenderer": "sim.render.batched_renderer",
    "ReferenceRenderer": "sim.render.reference_renderer",
    "ModelRenderer": "sim.render.model_renderer",
    "choose_model_fidelity": "sim.render.model_fidelity",
    "Mount": "sim.eyes.mounts",
    "both_sides": "sim.eyes.mounts",
    "fan": "sim.eyes.mounts",
    "ring": "sim.eyes.mounts",
    "Poses": "sim.scene.poses",
    "Task": "sim.tasks.task",
    "BatchTask": "sim.tasks.batch_task",
    "Outcome": "sim.tasks.outcome",
    "RewardTerms": "sim.tasks.outcome",
    "Physics": "sim.physics.physics",
    "ArrayWorlds": "sim.physics.array_worlds",
    "SlidingAgents": "sim.physics.sliding_agents",
    "Encounter": "sim.tasks.encounter",
    "Frozen": "sim.tasks.encounter",
    "Fidelity": "sim.render.fidelity",
    "FidelityWarning": "sim.render.fidelity_choice",
    "choose_fidelity": "sim.render.world_fidelity",
    "make_env": "sim.envs.env",
    "check_batch_task": "sim.envs.batch_task_checker",
    "make_vec_env": "sim.envs.assembly",
    "make_parallel_env": "sim.envs.assembly",
    "register_task": "sim.envs.registration",
    "set_threads": "sim.envs.threads",
    "View": "sim.exr.view",
    "read_exr": "sim.exr.files",
    "write_exr": "sim.exr.files",
    "ReceptorMosaic": "sim.pictures.receptor_mosaic",
    "read_photograph": "sim.pictures.photograph",
    "see_photograph": "sim.pictures.photograph",
}

__all__ = [
    "TASKS",
    "ArrayWorlds",
    "BatchTask",
    "BatchedRenderer",
    "CompoundEye",
    "Course",
    "Encounter",
    "Eyes",
    "Fidelity",
    "FidelityWarning",
    "Frozen",
    "LayoutFamily",
    "Mirror",
    "MirrorWarning",
    "ModelRenderer",
    "Mount",
    "Outcome",
    "Physics",
    "Poses",
    "ReceptorMosaic",
    "ReferenceRenderer",
    "RewardTerms",
    "SlidingAgents",
    "Task",
    "View",
    "World",
    "both_sides",
    "build_world",
    "check_batch_task",
    "choose_fidelity",
    "choose_model_fidelity",
    "fan",
    "hexagonal_patch",
    "hexagonal_rows",
    "make_env",
    "make_parallel_env",
    "make_vec_env",
    "mirror",
    "read_exr",
    "read_photograph",
    "register_task",
    "ring",
    "see_photograph",
    "set_threads",
    "whole_head",
    "write_exr",
]

TASKS = tuple(catalog.TASKS)

register_environments()


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'sim' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
