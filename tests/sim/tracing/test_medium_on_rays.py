"""Water and air along rays: closed form, Mitsuba's homogeneous medium, areas against rays, and predicted errors."""

import drjit as dr
import mitsuba as mi
import mujoco
import numpy as np
import pytest

import optics
import sim
from optics.spectra.spectrum import Spectrum
from sim.eyes.depth_layers import ONE_PSF
from sim.eyes.mounts import Mount
from sim.render import fidelity_stages
from sim.render.fidelity import Fidelity
from sim.render.fidelity_trials import FidelityTrials
from sim.render.world_scene import WorldScene
from sim.scene.variant import variant

BANDS = 3
EYES = sim.Eyes(n_eyes=2, resolution=(4, 4), fov_deg=60, bands=BANDS, noise_sigma=0.02)
# A luminous wall across the visual field, 2 m from the eye.
WALL = """
<mujoco>
  <asset><material name="lamp" rgba="1 1 1 1" emission="1"/></asset>
  <worldbody>
    <body name="eye" pos="0 0 0"><freejoint/><geom name="head" type="sphere" size="0.01" mass="1"/></body>
    <geom type="box" size="0.1 20 20" pos="2.1 0 0" material="lamp"/>
  </worldbody>
</mujoco>
"""
ABSORPTION, DISTANCE = 0.4, 2.0


def constant(c, veil):
    return optics.TurbidMedium(Spectrum((500,), (c,)), Spectrum((500,), (veil,)))


def radiance(medium, n=16):
    """Radiance of the luminous wall that each receptor of a row sees, (width,)."""
    model = mujoco.MjModel.from_xml_string(WALL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    eye = optics.Eye(resolution=(1, 5), fov_deg=80.0, bands=BANDS)
    renderer = sim.ModelRenderer(
        model, eye, [Mount("eye", offset=(0.011, 0, 0))], fidelity=Fidelity(n, BANDS, light="bounce"), medium=medium
    )
    return renderer.receptor_radiance(data)[1, 0, 0, 0]


def test_light_through_a_medium_is_that_of_mitsubas_homogeneous_medium():
    passed = radiance(constant(ABSORPTION, 0.0), 256) / radiance(None, 256)
    with variant("scalar_rgb"):
        absorbing = {"type": "homogeneous", "albedo": 0.0, "sigma_t": ABSORPTION}
        eye = 0.011  # the wall is at x = 2
        scene = mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "volpath", "max_depth": 2},
                "wall": {
                    "type": "rectangle",
                    "to_world": mi.ScalarTransform4f().translate([DISTANCE, 0, 0]).rotate([0, 1, 0], -90).scale(20),
                    "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 1.0}},
                },
                "sensor": {
                    "type": "perspective",
                    "fov": 80.0,
                    "to_world": mi.ScalarTransform4f().look_at([eye, 0, 0], [1, 0, 0], [0, 0, 1]),
                    "medium": absorbing,
                    "film": {"type": "hdrfilm", "width": 5, "height": 1, "rfilter": {"type": "box"}},
                    "sampler": {"type": "independent", "sample_count": 2**14},
                },
            }
        )
        reference = np.array(mi.render(scene))[0, :, 1]
    assert passed == pytest.approx(reference, abs=4 * 0.5 / 2**7)  # noise of 2^14 samples
    # The mean of exp(-c d) over each receptor's square field.
    nodes, half = (np.arange(16) + 0.5) / 16 - 0.5, np.tan(np.radians(40)) / 2.5
    across, up = np.meshgrid((np.arange(5)[:, None] - 2 + nodes).ravel() * half, nodes * half, indexing="ij")
    mean = np.exp(-ABSORPTION * (DISTANCE - eye) * np.sqrt(1 + across**2 + up**2)).reshape(5, -1).mean(axis=1)
    assert passed == pytest.approx(mean, rel=1e-3)


def test_veiling_light_replaces_the_light_that_a_medium_takes():
    # A surface as bright as the veiling light looks the same at every distance.
    clear, veiled = radiance(None), radiance(constant(ABSORPTION, 1.0))
    passed = radiance(constant(ABSORPTION, 0.0)) / clear
    at_infinity = radiance(constant(1e4, 1.0))
    assert veiled == pytest.approx(clear * passed + at_infinity * (1 - passed), rel=1e-4)


def poses(world, scene, n=6):
    rng = np.random.default_rng(1)
    position, heading = world.agent_spawn[rng.integers(0, len(world.agent_spawn), n)], rng.uniform(0, 2 * np.pi, n)
    objects = np.zeros((n, len(world.objects), 3))
    if world.objects:
        objects[..., :2] = world.object_spawn[
            rng.permutation(len(world.object_spawn))[: n * len(world.objects)]
        ].reshape(n, -1, 2)
        objects[..., 2] = 0.2
    return scene.poses_at(position, heading, objects)


def seen(world, fidelity, tracer="auto"):
    renderer = sim.BatchedRenderer(world, EYES, 6, fidelity, tracer=tracer)
    return renderer.signals(poses(world, renderer.scene))


@pytest.mark.parametrize("task", ["detection", "navigation"])
def test_all_tracers_agree_in_water(task):
    world = sim.build_world(task, medium="coastal_water")
    rays = seen(world, Fidelity(1024, BANDS), "closed_form")
    # The same rays, through meshes.
    assert seen(world, Fidelity(16, BANDS), "mitsuba") == pytest.approx(
        seen(world, Fidelity(16, BANDS), "closed_form"), abs=2e-3
    )
    # Areas: the transmission is averaged at two distances per surface and area.
    errors = [np.sqrt(np.mean((seen(world, Fidelity(n, BANDS, samples="areas")) - rays) ** 2)) for n in (1, 16)]
    assert errors[0] < 5e-3
    assert errors[1] < 1.5e-3


def test_rays_of_one_surface_have_the_closed_form():
    # A corridor that is black in every direction: all light is veiling light.
    world = sim.build_world("navigation", medium=constant(1e3, 0.5))
    signals = seen(world, Fidelity(4, BANDS))
    assert signals == pytest.approx(0.5, rel=1e-5)
    areas = seen(world, Fidelity(4, BANDS, samples="areas"))
    assert areas == pytest.approx(0.5, rel=1e-5)


def test_without_a_medium_nothing_changes():
    world, clear = sim.build_world("detection"), sim.build_world("detection", medium="air")
    assert world.medium is clear.medium is None
    thin = sim.build_world("detection", medium=constant(0.0, 0.0))
    for fidelity in (Fidelity(4, BANDS), Fidelity(4, BANDS, samples="areas")):
        assert np.array_equal(seen(world, fidelity), seen(clear, fidelity))
        assert seen(thin, fidelity) == pytest.approx(seen(world, fidelity), abs=1e-5)


def test_the_trials_for_a_fidelity_see_the_medium():
    world = sim.build_world("detection", medium=optics.fog(2.0))
    scene = WorldScene(world, EYES)
    sampling = scene.sampling(ONE_PSF, None)
    predicted = FidelityTrials(scene).errors(sampling)(4.0)
    error = np.sqrt(np.mean((seen(world, Fidelity(4, BANDS)) - seen(world, Fidelity(1024, BANDS))) ** 2))
    assert predicted / 3 < error < 1.5 * predicted
    # In clear air, contrasts are larger, and so are errors.
    assert predicted < 0.4 * FidelityTrials(WorldScene(sim.build_world("detection"), EYES)).errors(sampling)(4.0)


def test_the_choice_of_bands_includes_the_medium():
    water, clear = sim.build_world("detection", medium="clear_ocean"), sim.build_world("detection")
    eye = EYES.eye()
    assert fidelity_stages.own_bands(clear, eye).predicted_error is None
    own = fidelity_stages.own_bands(water, eye)
    assert own.predicted_error == pytest.approx(water.medium.band_error(BANDS, "rgb"))
    # Few bands cannot represent a coefficient that changes much within a band.
    dyed = optics.TurbidMedium(Spectrum((500, 700), (0, 9)), Spectrum((500,), (0.0,)))
    (few, _), (more, level) = (fidelity_stages.bands(eye, 0.03, medium) for medium in (None, dyed))
    assert more > few
    assert dyed.band_error(more, "rgb") <= level.predicted_error == 0.03 < dyed.band_error(more - 1, "rgb")


def test_the_error_of_the_largest_number_of_bands_is_reported():
    line = optics.TurbidMedium(Spectrum((549, 550, 551), (0.0, 100.0, 0.0)), Spectrum((500,), (0.0,)))
    bands, level = fidelity_stages.bands(EYES.eye(), 0.01, line)
    assert (bands, level.level) == (64, "64")
    assert level.predicted_error == pytest.approx(line.band_error(64, "rgb"))
    assert level.why.startswith("most, not enough for 1.0e-02")


def test_fog_is_brighter_and_flatter_and_the_space_of_observations_contains_it():
    venv = sim.make_vec_env("detection", EYES, 4, medium=optics.fog(2.0), rays_per_receptor=4)
    observation = venv.reset()["eyes"]
    assert observation.mean() > 0.8
    assert venv.observation_space["eyes"].contains(observation[0])
    venv.close()


@pytest.mark.parametrize("medium", ["milk", 3])
def test_another_medium_is_refused_in_one_line(medium):
    with pytest.raises(ValueError, match="build_world: medium") as raised:
        sim.build_world("detection", medium=medium)
    assert "\n" not in str(raised.value)


def test_the_reference_renderer_refuses_media():
    with pytest.raises(ValueError, match="medium must be None"):
        sim.ReferenceRenderer(sim.build_world("detection", medium="fog"), EYES)


def test_rays_into_nothing_show_the_veiling_light():
    from sim.tracing.medium_on_rays import MediumOnRays

    with variant("llvm_ad_spectral"):
        medium = MediumOnRays.from_bands(optics.BandMedium(np.array([0.0, 0.1]), np.array([0.3, 0.7])), np.eye(2))
        found = medium.through([mi.Float(0.0)] * 2, mi.Float(dr.inf))
        assert [v.numpy()[0] for v in found] == pytest.approx([0.3, 0.7])
