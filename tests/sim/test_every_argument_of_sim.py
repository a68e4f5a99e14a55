"""Every optional argument of the public functions and classes of `sim` changes a result, or names the test that shows
its effect."""

import os

import mujoco
import numpy as np
import pytest

import optics
import sim
from sim import Fidelity, Mount
from tests.sim.walked_worlds import IN_WORLDS, RAYS
from tests.walked_arguments import NoEffect, Walk, With, missing

XML = """<mujoco><worldbody>
  <light name="lamp" pos="0 0 3" dir="0 0 -1" diffuse="0.8 0.8 0.8"/>
  <geom name="floor" type="plane" size="3 3 .1" rgba=".5 .6 .7 1"/>
  <geom name="hidden" type="box" size=".2 .2 .2" pos="1.5 .4 .3" rgba="1 0 0 1" group="3"/>
  <body name="ball" pos="1 0 .3"><freejoint/><geom type="sphere" size=".2" rgba=".9 .2 .1 1"/>
    <site name="ball" pos="0 0 .5"/></body>
  <body name="head" pos="0 0 .3"><joint type="hinge" axis="0 0 1"/><geom type="sphere" size=".05" mass="1"/>
    <site name="eye" pos=".1 0 0"/></body>
</worldbody></mujoco>"""
MODEL = mujoco.MjModel.from_xml_string(XML)
DATA = mujoco.MjData(MODEL)
mujoco.mj_forward(MODEL, DATA)
MOVED = mujoco.MjData(MODEL)
MOVED.qpos[0] += 0.2
mujoco.mj_forward(MODEL, MOVED)
EYE = optics.Eye(None, (4, 4), 70.0, bands=3)
PHOTO = np.full((12, 16, 3), 0.5)
MOSAIC = sim.ReceptorMosaic("mouse", np.linspace(0, 1, 24).reshape(2, 3, 4), (508.0, 360.0), 20.0, False)


def rendered(mount=None, **given):
    """Return the signals of an eye on the model, by default at its camera."""
    renderer = sim.ModelRenderer(MODEL, EYE, [mount or Mount("eye")], **{"fidelity": RAYS, **given})
    return np.asarray(renderer.signals([DATA] * renderer.n_envs))


def ommatidia(**given):
    """Return the signals of a compound eye, and their noise."""
    facet = optics.Ommatidium(optics.FacetLens(16e-6, 12e-6), optics.Waveguide(1.9e-6))
    eye = sim.CompoundEye([[0.0, -20.0], [30.0, -10.0]], facet, **{"bands": 3, **given})
    renderer = sim.ModelRenderer(MODEL, eye, [Mount("eye")], fidelity=Fidelity(4, bands=eye.bands))
    return renderer.signals(DATA), eye.noise_sigma, eye.photons


def written(tmp="view.exr", **given):
    aspect = given.pop("pixel_aspect", None)
    view = sim.View("left", **{"wavelengths_nm": np.array([500.0]), "radiance": np.full((1, 2, 2), 0.5), **given})
    sim.write_exr(tmp, [view], **({} if aspect is None else {"pixel_aspect": aspect}))
    with open(tmp, "rb") as file:
        return file.read().hex()


def image_file(**given):
    MOSAIC.write_png("mosaic.png", **given)
    with open("mosaic.png", "rb") as file:
        return file.read().hex()


ON_MODELS = {
    "CompoundEye": Walk(
        ommatidia,
        {
            "receptors": "lms",
            "types": [[0], [2]],
            "bands": 2,
            "noise_sigma": 0.5,
            "photon_budget": optics.PhotonBudget(1.0),
            "radius": 0.6,
            "rows": 2,
        },
    ),
    "hexagonal_rows": Walk(lambda **given: sim.hexagonal_rows(2, 4, 60.0, **given), {"acute_zone": 2.0}),
    "hexagonal_patch": Walk(
        lambda **given: sim.hexagonal_patch(1, 5.0, **given), {"azimuth_deg": 9.0, "elevation_deg": 9.0}
    ),
    "Mount": Walk(
        lambda **given: rendered(Mount(given.pop("on", "eye"), **given)),
        {
            "azimuth_deg": 10.0,
            "elevation_deg": 10.0,
            "roll_deg": 30.0,
            "offset": (0.0, 0.0, 0.2),
            "kind": With("body", {"on": "ball", "elevation_deg": -30.0, "offset": (0.3, 0.0, 0.0)}),
        },
    ),
    "fan": Walk(
        lambda **given: [str(mount) for mount in sim.fan(Mount("eye"), 2, 60.0, **given)], {"elevation_deg": 9.0}
    ),
    "ModelRenderer": Walk(
        rendered,
        {
            "n_envs": 2,
            "fidelity": Fidelity(3, bands=3),
            "groups": (0, 1, 2, 3),
            "spectra": {"lamp": "A"},
            "varied": NoEffect("it allows `Poses` with varied values: tests/sim/scene change them"),
            "tracer": NoEffect("all tracers give the same signals: tests/sim/tracing compare them"),
            "medium": "fog",
        },
    ),
    "ModelRenderer.signals": Walk(
        lambda **given: sim.ModelRenderer(MODEL, EYE, [Mount("eye")], fidelity=RAYS).signals([DATA], **given),
        {"light": np.full((1, 3), 0.5)},
    ),
    "choose_model_fidelity": Walk(
        lambda **given: sim.choose_model_fidelity(
            *(MODEL, EYE, [Mount("eye")], [DATA, MOVED]), **{"tolerance": 0.05, **given}
        ),
        {
            "tolerance": 0.3,
            "groups": NoEffect("as in ModelRenderer"),
            "spectra": NoEffect("as in ModelRenderer"),
            "varied": NoEffect("as in ModelRenderer"),
            "light": "bounce",
            "medium": "fog",
        },
    ),
    "View": Walk(
        written,
        {
            "wavelengths_nm": np.array([600.0]),
            "radiance": np.zeros((1, 2, 2)),
            "receptors": With(np.ones((2, 2, 2)), {"peaks_nm": None}),
            "rgb": np.ones((2, 2, 3)),
            "attributes": {"seed": 3},
            "peaks_nm": With(
                (500.0, 400.0), {"radiance": None, "wavelengths_nm": np.empty(0), "receptors": np.ones((2, 2, 2))}
            ),
            "reflectance": np.full((1, 2, 2), 0.2),
            "directions": With(np.ones((3, 2, 2)), {"receptors": np.ones((2, 2, 2))}),
        },
    ),
    "see_photograph": Walk(
        lambda progress=None, **given: sim.see_photograph(PHOTO, "mouse", 20.0, progress=progress, **given).signals,
        {"uv": 0.0, "depth": 0.01, "progress": NoEffect("sim/pictures/test_photograph.py: the calls of this function")},
    ),
    "ReceptorMosaic.image": Walk(MOSAIC.image, {"photograph": PHOTO, "height": 40}),
    "ReceptorMosaic.write_png": Walk(image_file, {"photograph": PHOTO, "height": 40}),
    "write_exr": Walk(written, {"pixel_aspect": 2.0}),
    "read_exr": Walk(lambda **given: outcome(lambda: sim.read_exr("view.exr", **given)), {"most_bytes": 10}, {}),
}
# Other tests change each of these arguments, because a call takes seconds or is a part of a larger one.
ELSEWHERE = {
    name: Walk(dict, dict.fromkeys(names, NoEffect(where)))
    for name, names, where in (
        ("set_threads", ("count",), "tests/sim/envs/test_threads.py"),
        ("BatchedRenderer", ("fidelity", "tracer"), "tests/sim/render"),
        ("BatchedRenderer.launch", ("light",), "as ModelRenderer.signals"),
        ("BatchedRenderer.launch_some", ("light",), "as ModelRenderer.signals"),
        ("BatchedRenderer.signals", ("light",), "as ModelRenderer.signals"),
        ("ModelRenderer.launch", ("light",), "as ModelRenderer.signals"),
        ("ModelRenderer.launch_some", ("light",), "as ModelRenderer.signals"),
        (
            "Fidelity",
            ("depth", "frames", "levels", "light", "samples", "tolerance"),
            "tests/sim/render: they describe a choice",
        ),
        ("Frozen", ("policy",), "tests/sim/envs"),
        ("Mirror.render", ("integrator", "sampler", "seed", "spp", "wavelengths"), "tests/sim/scene"),
        ("mirror", ("bodies", "data", "groups", "spectra", "variant"), "tests/sim/scene"),
        ("Outcome", ("changed", "failure", "info", "over", "proprioception"), "tests/sim/tasks"),
        (
            "Poses",
            ("geom_matid", "geom_rgba", "geom_size", "heights", "light_active", "light_diffuse", "mat_emission"),
            "tests/sim/scene",
        ),
        (
            "ReferenceRenderer",
            ("depth_layers", "depths", "integrator", "sampler", "samples_per_receptor", "seed", "spp", "variant"),
            "tests/sim/render: it is the reference of other renderers",
        ),
        ("SlidingAgents", ("threads", "variation"), "tests/sim/physics; threads changes only the speed"),
        ("World", ("alone", "episode_steps", "mazes", "medium", "spectra", "training_starts"), "build_world sets them"),
        ("check_batch_task", ("n_envs", "steps"), "tests/sim/envs: it returns nothing"),
        ("choose_fidelity", ("bands", "tolerance", "tracer"), "tests/sim/render"),
    )
}
ELSEWHERE["Poses"].changes.update(dict.fromkeys(("mat_rgba", "others"), NoEffect("tests/sim/scene")))
TABLE = {**IN_WORLDS, **ON_MODELS, **ELSEWHERE}


def outcome(call):
    """Return the result of a call in words, or its error."""
    try:
        return str(type(call()))
    except ValueError as error:
        return str(error)


@pytest.fixture(autouse=True)
def _in_a_new_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written()
    assert os.path.exists("view.exr")


def test_the_table_names_every_optional_argument():
    assert missing(sim, TABLE) == []


QUICK = (
    "View",
    "see_photograph",
    "ReceptorMosaic.image",
    "ReceptorMosaic.write_png",
    "write_exr",
    "read_exr",
    "fan",
    "Course",
    "build_world",
)


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if name in QUICK else [pytest.mark.slow]) for name in {**IN_WORLDS, **ON_MODELS}],
)
def test_every_argument_changes_a_result(name):
    assert TABLE[name].unchanged() == []
