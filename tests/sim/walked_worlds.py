"""Calls of worlds, environments and eyes of `sim`, for the walk of arguments."""

from contextlib import closing

import numpy as np

import optics
import sim
from sim import Eyes, Fidelity
from tests.sim.envs.hunt import hunt
from tests.walked_arguments import Walk, With

PERFECT = {"resolution": (4, 4), "n_eyes": 1, "bands": 3, "fov_deg": 70.0}
RAYS = Fidelity(2, bands=3)
PUPIL = optics.Pupil(10e-6, thin_lens_focal_length=240e-6)


def looked(**given):
    """Return observations of an agent with these eyes."""
    return played(eyes=Eyes(**{**PERFECT, **given}), rays_per_receptor=2)


def played(task="detection", steps=2, **given):
    """Return the first observations, images and rewards of an environment."""
    asked = {"eyes": Eyes(**PERFECT), "n_envs": 2, "fidelity": RAYS, **given}
    if "rays_per_receptor" in given:
        del asked["fidelity"]
    with closing(sim.make_vec_env(task, **asked)) as env:
        found = [env.reset(), env.get_images() if env.render_mode else None]
        for _ in range(steps):
            found.append(env.step(np.full((env.num_envs, 2), 0.7, np.float32))[:3])
        return found


def world(**given):
    found = sim.build_world(given.pop("task", "maze"), **given)
    return (
        found.model.geom_pos,
        found.model.geom_rgba,
        found.model.ncam,
        sorted(found.spectra),
        found.mazes,
        found.episode_steps,
        None if found.medium is None else found.medium.veil.values,
    )


def met(**given):
    with closing(sim.make_parallel_env(hunt(), **given)) as env:
        observations, _ = env.reset()
        return observations, None if env.render_mode is None else env.render()


FACET = optics.Ommatidium(optics.FacetLens(20e-6, 18e-6), optics.Waveguide(2e-6))
SMALL_FAMILY = {"seed": 0, "n_training": 1, "n_selection": 1, "n_test": 1, "rows": 13, "columns": 21}
FAMILY = sim.LayoutFamily(**SMALL_FAMILY)


def drawn(family):
    """Drawings of all courses, and the number of actions."""
    sets = (family.training, family.selection, family.test)
    steps = sim.build_world("navigation", layouts=family.training).episode_steps
    return steps, [[course.drawing for course in one.courses] for one in sets]


IN_WORLDS = {
    "make_vec_env": Walk(
        played,
        {
            "eyes": Eyes(**{**PERFECT, "fov_deg": 90.0}),
            "n_envs": 3,
            "seed": 5,
            "memory": 2,
            "mode": With("evaluation", {"steps": 40}),
            "rays_per_receptor": With(3, {"rays_per_receptor": 1}),
            "fidelity": Fidelity(3, bands=3),
            "world_seed": With(2, {"task": "maze"}),
            "mazes": With(3, {"task": "maze", "n_envs": 6}),
            "course": With("long", {"task": "navigation"}),
            "layouts": With(FAMILY.training, {"task": "maze"}),
            "wall_height": With(0.5, {"task": "maze"}),
            "least_return": With(-0.01, {"steps": 30}),
            "episode_steps": With(2, {"steps": 4}),
            "spectra": {"light_0": "A"},
            "medium": "fog",
            "vary": {"light": (0.1, 0.5)},
            "auxiliary": ("depth",),
            "render_mode": "eyes",
        },
    ),
    "Eyes": Walk(
        looked,
        {
            "n_eyes": 2,
            "resolution": (3, 4),
            "fov_deg": 90.0,
            "placement_range_deg": With(90.0, {"n_eyes": 2}),
            "optics": PUPIL,
            "sensor_width": With(3e-4, {"optics": PUPIL}),
            "noise_sigma": 0.2,
            "bands": 4,
            "receptors": "honeybee",
            "photon_budget": optics.PhotonBudget(100.0),
            "waveguide": With(optics.Waveguide(2e-6), {"optics": PUPIL, "resolution": (2, 2)}),
            "pupil_turned": With(
                True,
                {"optics": optics.Pupil(20e-6, wavefront=optics.Zernike({(1, 1): 4.0}), thin_lens_focal_length=240e-6)},
            ),
            "vertical_fov_deg": 30.0,
            "dynamics": optics.ReceptorDynamics(200.0),
            "density": optics.Fovea(10.0),
            "ommatidium": FACET,
            "acute_zone": With(2.0, {"ommatidium": FACET}),
        },
    ),
    "build_world": Walk(
        world,
        {
            "seed": 3,
            "mazes": 2,
            "course": With("long", {"task": "navigation"}),
            "layouts": FAMILY.training,
            "wall_height": 0.5,
            "eyes": Eyes(),
            "spectra": {"wall": "foliage"},
            "medium": "fog",
        },
    ),
    "make_env": Walk(
        lambda **given: sim.make_env("detection", rays_per_receptor=1, **given).observation_space.spaces.__repr__(),
        {"eyes": Eyes(resolution=(3, 3))},
    ),
    "LayoutFamily": Walk(
        lambda **given: drawn(sim.LayoutFamily(**{**SMALL_FAMILY, **given})),
        {"seed": 1, "n_training": 2, "n_selection": 2, "n_test": 2, "rows": 9, "columns": 17, "path_width": 1}
        | {"episode_steps": 7},
    ),
    "make_parallel_env": Walk(met, {"seed": 3, "memory": 2, "render_mode": "eyes"}),
    "Course": Walk(
        lambda **given: sim.build_world("navigation", course=sim.Course(DRAWING, **given)).episode_steps,
        {"episode_steps": 7},
    ),
}
DRAWING = "\n".join(["#" * 9, "#.......#", "#.S.....#", "#.......#", "#" * 9])
