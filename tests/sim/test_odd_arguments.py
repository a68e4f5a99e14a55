"""Arguments of the wrong type or value in `sim`: a result, or a one-line error of our own. See the test of the same
name in optics.
"""

from functools import cache

import mujoco
import numpy as np
import pytest
from PIL import Image

import optics
import sim
from sim.scene.cameras import Viewpoint
from sim.scene.poses import world_indices
from sim.worlds.layout_family import LayoutSet
from tests.odd_arguments import complaints, masked_complaints
from tests.sim.envs.hunt import Prey
from tests.slow_part import slow

MOUNT = sim.Mount("head", 30.0)
VIEW = {"name": "left", "wavelengths_nm": np.array([450.0]), "radiance": np.ones((1, 2, 2), np.float32)}
CALLS = {
    "Eyes": {
        "n_eyes": 2,
        "resolution": (3, 3),
        "fov_deg": 45.0,
        "placement_range_deg": 60.0,
        "optics": None,
        "sensor_width": 200e-6,
        "noise_sigma": 0.01,
        "bands": 4,
        "receptors": "rgb",
        "photon_budget": None,
        "waveguide": None,
        "pupil_turned": False,
        "ommatidium": None,
        "acute_zone": 1.0,
    },
    "Fidelity": {"rays_per_receptor": 8.0, "bands": 4, "tolerance": None, "light": "direct", "samples": "rays"},
    "Mount": {
        "on": "head",
        "azimuth_deg": 0.0,
        "elevation_deg": 0.0,
        "roll_deg": 0.0,
        "offset": (0.0, 0.0, 0.0),
        "kind": None,
    },
    "CompoundEye": {
        "directions": [[0.0, 0.0], [20.0, 0.0]],
        "ommatidium": optics.Ommatidium(optics.FacetLens(25e-6, 30e-6), optics.Waveguide(2e-6)),
        "receptors": "rgb",
        "types": None,
        "bands": 4,
        "noise_sigma": 0.01,
        "photon_budget": None,
        "radius": None,
        "rows": None,
    },
    "hexagonal_rows": {"rows": 2, "columns": 3, "fov_deg": 60.0, "acute_zone": 1.0},
    "hexagonal_patch": {"rings": 1, "interommatidial_deg": 5.0, "azimuth_deg": 0.0, "elevation_deg": 0.0},
    "whole_head": {"interommatidial_deg": 30.0},
    "View": VIEW | {"receptors": None, "rgb": None},
    "both_sides": {"mounts": [MOUNT]},
    "build_world": {"task": "navigation", "seed": 0, "mazes": 1, "course": "short", "eyes": None, "spectra": None},
    "fan": {"mount": MOUNT, "n_eyes": 2, "placement_range_deg": 40.0, "elevation_deg": 0.0},
    "ring": {"on": "head", "n_eyes": 2, "placement_range_deg": 40.0, "radius": 0.1},
}


XML = """<mujoco><worldbody>
  <light name="lamp" pos="0 0 3" dir="0 0 -1"/><camera name="side" pos="0 -3 .3" xyaxes="1 0 0 0 0 1"/>
  <geom name="floor" type="plane" size="3 3 .1"/>
  <body name="ball" pos="1 0 .3"><freejoint/><geom name="ball" type="sphere" size=".2"/><site name="eye" pos="-.3 0 0"/>
  </body></worldbody></mujoco>"""
MODEL = mujoco.MjModel.from_xml_string(XML)
DATA = mujoco.MjData(MODEL)
mujoco.mj_forward(MODEL, DATA)
WORLD, EYES, FEW_RAYS = sim.build_world("detection"), sim.Eyes(1, (1, 2), bands=2), sim.Fidelity(1.0, bands=2)
EYE, ON_BALL = optics.Eye(None, (1, 2), bands=2), [sim.Mount("eye")]
ON_MODEL = {"model": MODEL, "eye": EYE, "mounts": ON_BALL, "groups": (0, 1, 2), "spectra": None, "varied": ()}
OMMATIDIA = sim.CompoundEye(**CALLS["CompoundEye"])
PHOTO = np.ones((9, 9, 3))


class Lazy(sim.BatchTask):
    model, eye, mounts, fidelity = MODEL, EYE, ON_BALL, FEW_RAYS

    def n_actions(self, model):
        return 1

    def act(self, worlds, actions):
        return None

    def rewards(self, worlds):
        return {"nothing": np.zeros(worlds.n)}


SIGNALS = {"animal": "mouse", "signals": np.ones((2, 3, 4)), "peaks_nm": (508.0, 360.0), "width_deg": 20.0}
MOSAIC = sim.ReceptorMosaic(**SIGNALS, hexagons=False)
SEEN = {"camera": "side", "width": 2, "height": 1}
PLACES = {"n": 2, "threads": 1, "variation": None}


@cache
def mirrored():
    return sim.mirror(MODEL)


@cache
def renderer():
    return sim.ModelRenderer(MODEL, EYE, ON_BALL, 2, FEW_RAYS)


def of_files(call):
    """Return the call in a folder with an image `a.exr` and a photograph `a.png`."""

    def called(**given):
        sim.write_exr("a.exr", [sim.View(**VIEW)])
        Image.fromarray(np.zeros((9, 9, 3), np.uint8)).save("a.png")
        return call(**given)

    return called


# Further calls, which are methods, need files, or take about a second.
METHODS = {
    "ArrayWorlds": (lambda **given: sim.ArrayWorlds(XML, **given), PLACES | {"model": MODEL, "substeps": 1}),
    "CompoundEye.acceptance": (OMMATIDIA.acceptance, {"kind": 0}),
    "CompoundEye.directions_on": (OMMATIDIA.directions_on, {"mounts": ON_BALL}),
    "Course": (sim.Course, {"drawing": "########\n#S.....#\n########", "episode_steps": 5}),
    "Encounter": (lambda task: sim.Encounter(task), {"task": Prey()}),
    "Encounter.alone": (sim.Encounter(Prey()).alone, {"name": "Prey", "policies": {}}),
    "Frozen": (sim.Frozen, {"task": Prey(), "policy": None}),
    "LayoutFamily": (
        sim.LayoutFamily,
        {
            **dict.fromkeys(("n_training", "n_selection", "n_test"), 1),
            "seed": 0,
            "rows": 13,
            "columns": 39,
            "path_width": 3,
            "episode_steps": 5,
        },
    ),
    "LayoutFamily.number": (sim.LayoutFamily().number, {"name": "test"}),
    "LayoutFamily.random": (sim.LayoutFamily().random, {"name": "test", "index": 0, "purpose": 0}),
    "LayoutSet": (LayoutSet, {"family": sim.LayoutFamily(), "name": "test"}),
    "Mirror.bsdf": (lambda geom: mirrored().bsdf(geom), {"geom": "ball"}),
    "Mirror.render": (
        lambda **given: mirrored().render(**given),
        {**SEEN, "integrator": "direct", "spp": 1, "wavelengths": [5e-7], "seed": 0, "sampler": "independent"},
    ),
    "Mirror.render_depth": (lambda **given: mirrored().render_depth(**given), SEEN),
    "Mirror.sync": (lambda data: mirrored().sync(data), {"data": DATA}),
    "ModelRenderer": (
        sim.ModelRenderer,
        {**ON_MODEL, "n_envs": 2, "fidelity": FEW_RAYS, "tracer": "mitsuba", "medium": None},
    ),
    "ModelRenderer.launch_some": (
        lambda **given: renderer().launch_some(**given).wait(),
        {"poses": [DATA, DATA], "worlds": np.array([1]), "light": np.ones((2, 2))},
    ),
    "ModelRenderer.resized": (lambda n_envs: renderer().resized(n_envs), {"n_envs": 1}),
    "ModelRenderer.signals": (
        lambda **given: renderer().signals(**given),
        {"poses": [DATA, DATA], "light": np.ones((2, 2))},
    ),
    "Mount.found_in": (sim.Mount("eye").found_in, {"model": MODEL}),
    "Mount.local": (sim.Mount("eye").local, {"kind": "site"}),
    "Poses.from_data": (sim.Poses.from_data, {"datas": [DATA]}),
    "ReceptorMosaic": (sim.ReceptorMosaic, {**SIGNALS, "hexagons": False}),
    "ReceptorMosaic.image": (MOSAIC.image, {"photograph": PHOTO, "height": 40}),
    "ReceptorMosaic.write_png": (MOSAIC.write_png, {"path": "b.png", "photograph": PHOTO, "height": 40}),
    "RewardTerms": (sim.RewardTerms, {"names": ("a", "b"), "terms": np.ones((2, 3))}),
    "RewardTerms.of_rows": (sim.RewardTerms.of_rows, {"rows": [{"a": 1.0}]}),
    "RewardTerms[name]": (sim.RewardTerms(("a",), np.ones((1, 3))).__getitem__, {"name": "a"}),
    "SlidingAgents": (sim.SlidingAgents, PLACES | {"world": WORLD}),
    "View.from_ommatidia": (sim.View.from_ommatidia, {"name": "l", "eye": OMMATIDIA, "frame": np.ones((2, 3))}),
    "Viewpoint.looking_at": (
        Viewpoint.looking_at,
        {"origin": [1.0, 2.0, 3.0], "target": [0.0, 0.0, 0.0], "fovy_deg": 45.0},
    ),
    "make_parallel_env": (
        lambda **given: sim.make_parallel_env(**given).close(),
        {"encounter": sim.Encounter(Prey()), "seed": 0, "memory": 1, "render_mode": None},
    ),
    "mirror": (sim.mirror, {"model": MODEL, "data": DATA, "bodies": ["ball"], "groups": (0,), "spectra": None}),
    "mirror: variant": (lambda variant: sim.mirror(MODEL, variant=variant), {"variant": None}),
    "read_exr": (of_files(sim.read_exr), {"path": "a.exr", "most_bytes": 1e6}),
    "read_photograph": (of_files(sim.read_photograph), {"path": "a.png"}),
    "register_task": (sim.register_task, {"id_": "Odd-v0", "task": Prey()}),
    "world_indices": (lambda worlds: world_indices("worlds", worlds, 2), {"worlds": [0, 1]}),
    "write_exr": (sim.write_exr, {"path": "a.exr", "views": [sim.View(**VIEW)], "pixel_aspect": 1.0}),
}
SLOW = {
    "BatchedRenderer": (
        sim.BatchedRenderer,
        {"world": WORLD, "eyes": EYES, "n_envs": 1, "fidelity": FEW_RAYS, "tracer": "auto"},
    ),
    "ReferenceRenderer": (
        sim.ReferenceRenderer,
        {
            "world": WORLD,
            "eyes": EYES,
            "integrator": "path",
            "spp": 1,
            "samples_per_receptor": 1,
            "depths": None,
            "depth_layers": "auto",
            "sampler": "independent",
            "variant": None,
            "seed": 0,
        },
    ),
    "check_batch_task": (sim.check_batch_task, {"task": Lazy(), "n_envs": 2, "steps": 1}),
    "choose_fidelity": (
        sim.choose_fidelity,
        {"world": WORLD, "eyes": EYES, "tolerance": 0.5, "bands": "own", "tracer": "auto"},
    ),
    "choose_model_fidelity": (
        sim.choose_model_fidelity,
        {**ON_MODEL, "poses": [DATA], "tolerance": 0.5, "light": "direct", "medium": None},
    ),
    "make_env": (
        lambda **given: sim.make_env("detection", EYES, **given).close(),
        {
            "rays_per_receptor": 1.0,
            "memory": 1,
            "mode": "training",
            "world_seed": 0,
            "wall_height": 0.5,
            "episode_steps": 5,
            "vary": None,
            "auxiliary": (),
            "render_mode": None,
            "medium": None,
        },
    ),
    "see_photograph": (
        sim.see_photograph,
        {"photograph": PHOTO, "animal": "mouse", "width_deg": 2.0, "uv": 1.0, "depth": None, "progress": None},
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_any_argument(name):
    assert complaints(getattr(sim, name), CALLS[name]) == {}


@pytest.mark.filterwarnings("ignore::sim.MirrorWarning", "ignore::sim.FidelityWarning")
@pytest.mark.parametrize("name", [*METHODS, *map(slow, SLOW)])
def test_any_argument_of_methods(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert complaints(*{**METHODS, **SLOW}[name]) == {}


@pytest.mark.parametrize("name", CALLS)
def test_masked_elements_are_refused(name):
    """NumPy would use the numbers under the mask as data."""
    assert masked_complaints(getattr(sim, name), CALLS[name], np.random.default_rng(len(name))) == {}


def test_no_public_name_is_forgotten():
    """Omitted names are results or errors of sim itself, protocols, and classes whose users override methods."""
    made = {"FidelityWarning", "Mirror", "MirrorWarning", "Outcome", "Physics", "Poses", "TASKS", "World"}
    overridden = {"BatchTask", "Task"}
    elsewhere = {"make_vec_env", "set_threads"}  # here in `test_environments`, and in tests/sim/envs/test_threads.py
    assert CALLS.keys() | METHODS.keys() | SLOW.keys() | made | overridden | elsewhere >= set(sim.__all__)


def test_environments():
    """These arguments are refused before any environment is built."""
    valid = {"mode": "training", "least_return": -50.0, "auxiliary": (), "spectra": None, "mazes": 1, "n_envs": 1}
    fixed = {"task": "detection", "eyes": sim.Eyes(1, (1, 1)), "rays_per_receptor": 1.0}
    assert complaints(lambda **asked: sim.make_vec_env(**fixed, **asked).close(), valid) == {}
