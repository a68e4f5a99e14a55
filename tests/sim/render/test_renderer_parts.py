"""Small parts of renderers: factors of light, noise, filters in time, checks of poses, and what a renderer reports."""

import math
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import optics
import sim
from sim.eyes.compound_eye import CompoundEye
from sim.render import ray_kernel
from sim.render.eye_renderer import EyeRenderer
from sim.render.labels import Labels
from sim.render.light_factors import LightFactors
from sim.render.pending_frame import FrameSlot, PendingFrame, settled
from sim.render.prepared_scene import PreparedScene, _named
from sim.render.ray_kernel import RayKernel
from sim.render.receptor_noise import NoiseModel
from sim.render.receptors_in_time import ReceptorsInTime
from sim.render.reference_renderer import ReferenceRenderer, _pixels_per_cell

RNG = np.random.default_rng(3)


def test_factors_of_bands():
    """Rays are ordered by world, then by eye."""
    given = RNG.random((2, 3))
    factors = LightFactors.from_light(given, (2, 3))
    given[:] = 0
    assert factors.bands.dtype == np.float32
    assert (factors.bands > 0).all()
    layers = RNG.random((4, 3, 2 * 5 * 7)).astype(np.float32)
    found = factors.on_bands(layers, None, 5)
    for world in range(2):
        mine = slice(world * 35, (world + 1) * 35)
        np.testing.assert_allclose(found[:, :, mine], layers[:, :, mine] * factors.bands[world][None, :, None])
    basis = RNG.random((6, 3))
    components = RNG.random((4, 6, 70)).astype(np.float32)
    inbands = np.einsum("lkn,kb->lbn", components, basis)
    np.testing.assert_allclose(factors.on_bands(components, basis, 5), factors.on_bands(inbands, None, 5), rtol=1e-5)
    with pytest.raises(ValueError, match=r"^light has shape \(2, 3\): must be \(env, band\), \(3, 2\)$"):
        LightFactors.from_light(given, (3, 2))


def test_factors_that_are_one_number_per_world():
    level = LightFactors.from_light(np.array([[2.0, 2, 2], [3, 3, 3]]), (2, 3))
    assert level.is_level
    assert level.level.shape == (2, 1, 1, 1, 1)
    assert level.level.ravel().tolist() == [2, 3]
    assert not LightFactors.from_light(np.array([[2.0, 2, 2], [3, 3, 4]]), (2, 3)).is_level


def test_noise_of_eyes():
    assert NoiseModel.from_eye(SimpleNamespace(receptor_photons=None, noise_sigma=0.0)) is None
    assert NoiseModel.from_eye(SimpleNamespace(receptor_photons=None, noise_sigma=0.25)) == NoiseModel(0.25)
    photons = np.array([[4.0, 100.0]])
    found = NoiseModel.from_eye(SimpleNamespace(receptor_photons=photons, noise_sigma=0.0))
    assert (found.sigma, found.photons.dtype, found.photons.tolist()) == (0.0, np.float32, [[4, 100]])
    assert found.largest(2.0) == pytest.approx(1.0)
    assert NoiseModel(0.5, found.photons).largest(0.5) == pytest.approx(math.sqrt(0.25 + 0.25))
    assert NoiseModel(0.5).largest(1e9) == 0.5


def test_noise_of_frames():
    shot, rest = NoiseModel(0.5, np.array([8.0])).in_frames(0.25)
    assert (shot.sigma, shot.photons.tolist(), rest) == (0.0, [2.0], NoiseModel(0.5))
    assert NoiseModel(0.0, np.array([8.0])).in_frames(1.0)[1] is None
    assert NoiseModel(0.5).in_frames(0.25) == (None, NoiseModel(0.5))


def test_noisy_signals():
    """Shot noise has the variance s / N, and a third moment s / N² that its quadratic term adds."""
    signals, normals = np.array([0.5, 2.0], np.float32), np.array([1.5, -2.0], np.float32)
    np.testing.assert_allclose(NoiseModel(0.1)(signals, normals.copy()), [0.65, 1.8], rtol=1e-6)
    found = NoiseModel(0.1, np.float32(50))(signals, normals.copy())
    variance = signals / 50 + 0.01
    skew = signals / 50**2 * (normals**2 - 1) / (6 * variance)
    np.testing.assert_allclose(found, signals + np.sqrt(variance) * normals + skew, rtol=1e-5)
    dark = NoiseModel(0.0, np.float32(50))(np.array([-1.0, 0.0], np.float32), normals.copy())
    np.testing.assert_allclose(dark, [-1, 0], atol=1e-6)


def receptors(**dynamics):
    return ReceptorsInTime(optics.ReceptorDynamics(10.0, **dynamics), 3, (1, 1, 2, 4), 0.005)


@pytest.mark.parametrize(
    "dynamics",
    [
        {},
        {"order": 2, "latency_ms": 12.0},
        {"adaptation": "naka_rushton", "dark_light": 0.1},
        {"adaptation": "logarithmic", "latency_ms": 5.0},
        {"event_threshold": 0.1},
    ],
)
@pytest.mark.parametrize("motion", ["none", "hassenstein_reichardt", "barlow_levick"])
def test_constant_light_is_a_steady_state(dynamics, motion):
    """Responses begin with their values in constant light, and change in the worlds that advance only."""
    found, worlds = receptors(**dynamics, motion=motion), np.array([0, 2])
    assert found.channels == (1 if motion == "none" else 2)
    signals = RNG.random((2, 1, 1, 2, 4)).astype(np.float32) + 0.1
    found.start(signals, worlds)
    assert not found.state[1].any()
    begun = found.state.copy()
    first = found.step(signals, worlds)
    assert first.shape == (2, 1, found.channels, 2, 4)
    adaptation = dynamics.get("adaptation", "none")
    steady = {"naka_rushton": signals / (2 * signals + 0.1), "none": signals}.get(adaptation, 0 * signals)
    if "event_threshold" in dynamics:
        steady = 0 * signals
    np.testing.assert_allclose(first[:, :, :1], steady, rtol=1e-5, atol=1e-6)
    for _ in range(3):
        np.testing.assert_allclose(found.step(signals, worlds), first, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(found.state, begun, rtol=1e-5, atol=1e-6)


def test_frames_can_be_undone():
    found, worlds = receptors(), np.array([1, 2])
    signals = RNG.random((2, 1, 1, 2, 4)).astype(np.float32)
    found.start(signals, worlds)
    found.store(worlds)
    once = found.step(2 * signals, worlds)
    found.undo(np.array([2]))
    np.testing.assert_array_equal(found.step(2 * signals[1:], np.array([2])), once[1:])
    assert (found.step(2 * signals[:1], np.array([1])) > once[:1]).all()


def test_events_are_counted_until_they_are_read():
    found, worlds = receptors(event_threshold=0.1), np.array([0])
    signals = np.ones((1, 1, 1, 2, 4), np.float32)
    found.start(signals, worlds)
    counts = [found.step(3 * signals, worlds).mean() for _ in range(3)]
    assert 0 < counts[0] < counts[1] < counts[2] <= math.log(3) / 0.1
    found.reset_counts(worlds)
    assert found.step(3 * signals, worlds).mean() < counts[0]
    plain = receptors()
    plain.start(signals, worlds)
    plain.reset_counts(worlds)
    assert (plain.state[0] == 1).all()


def poses(**changes):
    """Return poses of two worlds with three geoms on two bodies."""
    given = {
        "n": 2,
        "geom_xpos": np.zeros((2, 3, 3)),
        "xpos": np.zeros((2, 2, 3)),
        "geom_xmat": np.tile(np.eye(3), (2, 3, 1, 1)),
    }
    return SimpleNamespace(**{**given, **changes})


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({}, None),
        ({"n": 3}, "poses of 3 worlds, this renderer was built for n_envs = 2"),
        ({"geom_xpos": np.zeros((2, 4, 3))}, "poses of another model"),
        ({"xpos": np.zeros((2, 3, 3))}, "poses of another model"),
        (
            {"geom_xpos": np.array([[[0, 0, 0]] * 3, [[0, 0, 0], [0, np.nan, 0], [0, 0, 0]]])},
            "poses of world 1 are not",
        ),
        ({"geom_xmat": np.array([[np.eye(3)] * 3, [np.zeros((3, 3))] * 3])}, "data of world 1 contains no poses yet"),
    ],
)
def test_poses_are_checked(changes, reason):
    compared = []
    scene = SimpleNamespace(
        model=SimpleNamespace(ngeom=3, nbody=2),
        scene=SimpleNamespace(as_built=SimpleNamespace(refuse_differences=compared.append)),
        check_count=PreparedScene.check_count,
        _check_finite=PreparedScene._check_finite,
    )
    given = poses(**changes)
    if reason is None:
        PreparedScene.check_poses(scene, given, 2)
        assert compared == [given]
        return
    with pytest.raises(ValueError, match=f"^{reason}"):
        PreparedScene.check_poses(scene, given, 2)
    assert compared == []


def test_names_of_models():
    for name, expected in ((" model='frog'", "the model 'frog'"), ("", "the model")):
        model = mujoco.MjModel.from_xml_string(f"<mujoco{name}><worldbody/></mujoco>")
        assert _named(model) == expected


def test_frames_in_a_slot():
    slot, log = FrameSlot(), []
    slot.clear()
    frames = [slot.launch(lambda k=k: lambda: log.append(k) or np.array([k])) for k in range(2)]
    assert log == [0], "a frame is read before the next one is launched"
    slot.clear()
    slot.clear()
    assert log == [0, 1]
    doubled = frames[1].then(lambda values: 2 * values)
    assert doubled.wait() == 2
    assert frames[0].wait() == 0
    for frame in (*frames, doubled):
        with pytest.raises(RuntimeError, match="this frame was waited for before"):
            frame.wait()
    ready = settled(np.array([5]))
    ready.settle()
    assert ready.wait() == 5
    assert isinstance(ready, PendingFrame)


def renderer(lights=(), sky=False, glows=False):
    found = EyeRenderer.__new__(EyeRenderer)
    found.scene = SimpleNamespace(
        scene=SimpleNamespace(
            lights=SimpleNamespace(found=[SimpleNamespace(kind=kind) for kind in lights]),
            has_sky=sky,
            glows=glows,
            moving=[1, 2, 3],
            spectra={"a": 1},
        )
    )
    return found


def test_what_a_renderer_reports():
    assert renderer(("directional",) * 2).only_directional
    for other in (
        renderer(("directional", "point")),
        renderer(("directional",), sky=True),
        renderer(("directional",), glows=True),
    ):
        assert not other.only_directional
    found = renderer()
    assert (found.moving, found.spectra) == (3, {"a": 1})
    found._rays, found._sums, found._edges = SimpleNamespace(n_recordings=1), SimpleNamespace(n_recordings=20), None
    assert found.recordings == 21
    found._edges = SimpleNamespace(recordings=300)
    assert found.recordings == 321
    vars(found)["labels"] = SimpleNamespace(recordings=4000)
    assert found.recordings == 4321


def test_the_brightest_signal():
    found = renderer()
    weights = np.array([[0.5, 0.5], [0.0, 1.0]])
    found.eye = SimpleNamespace(throughput=0.5, spectral_bands=SimpleNamespace(weights=weights))
    found._white = np.array([2.0, 1.0])
    assert found.brightest_in(np.ones(2)) == pytest.approx(0.75)
    assert found.brightest_in(np.array([1.0, 4.0])) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("receptor", "pixels"),
    [((1e-6, 1e-6), (1, 1)), ((3e-6, 2e-6), (3, 2)), ((2e-6, 3e-6), (2, 3)), ((16e-6, 1e-6), (16, 1))],
)
def test_receptors_are_made_of_square_pixels(receptor, pixels):
    assert _pixels_per_cell(receptor) == pixels


@pytest.mark.parametrize("ratio", [math.pi, 1.0001, 1e-3, 1e3])
def test_other_ratios_are_refused(ratio):
    with pytest.raises(ValueError, match=rf"makes receptors {ratio:.6g} times as high as wide"):
        _pixels_per_cell((ratio * 1e-6, 1e-6))


def test_a_reference_needs_clear_air():
    world = sim.build_world("maze", medium=optics.sea_water(1))
    with pytest.raises(ValueError, match=r"^world: its medium must be None, the reference renders clear air only$"):
        ReferenceRenderer(world, sim.Eyes(n_eyes=1, resolution=(1, 4)))


def test_compound_eyes_have_no_labels():
    eye = CompoundEye.__new__(CompoundEye)
    scene = SimpleNamespace(eye=eye, mounts=(), model=None)
    with pytest.raises(ValueError, match=r"^depth, ids and flow: are defined on a flat retina"):
        Labels(scene, 1)


@pytest.mark.parametrize("bands", range(1, 10))
def test_weights_of_samples_are_read_in_fours(monkeypatch, bands):
    given = []
    for name in ("floats", "one_number", "counted"):
        monkeypatch.setattr(ray_kernel, name, lambda values: given.append(values) or values)
    monkeypatch.setattr(ray_kernel, "Counts", SimpleNamespace(from_numbers=lambda *numbers: numbers))
    eyes = SimpleNamespace(directions=lambda ways, origins: (ways, origins))
    kernel = RayKernel(SimpleNamespace(light="direct", inputs=None), eyes, 2, 3, None)
    weights = RNG.random((7, bands))
    inputs = kernel.inputs(np.zeros((7, 3)), None, SimpleNamespace(origins="origins", weights=weights))
    found = inputs.weights
    assert found.shape == (7, 4 * math.ceil(bands / 4))
    np.testing.assert_array_equal(found[:, :bands], weights)
    assert not found[:, bands:].any()
    assert inputs.counts == (7, 3)
    assert [one for one in given if np.ndim(one) == 0] == [2 * 3 * 7, 2 * 3 * 7]
