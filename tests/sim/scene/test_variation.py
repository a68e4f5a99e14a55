"""Light that differs between episodes: against lamps with the same spectrum, CIE's chromaticities, and arithmetic."""

import contextlib
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.stats import kstest

import optics
import sim
from optics.spectra.spectrum import cie_1931, daylight
from sim.scene.variation import DAYLIGHT, Variation, filter_to
from sim.tasks.task_fidelity import fidelities_of
from tests.sim.envs.test_task_vec_env import CART, Face

NM = np.arange(380.0, 781.0, 5.0)
QUIET = optics.Eye(resolution=(4, 16), fov_deg=120, bands=24, noise_sigma=0.0)
SUN = CART.replace('<light type="directional"', '<light name="sun" type="directional"')


class Lit(Face):
    model = SUN
    eye, fidelity = QUIET, sim.Fidelity(4, bands=24)
    episode_steps = 3

    def __init__(self, **vary):
        self.vary = vary or None


def first_look(task, n=4, seed=0):
    with contextlib.closing(sim.make_vec_env(task, n_envs=n, seed=seed)) as env:
        seen = env.reset()["eyes"]
        return seen, env.simulation.varied, env.observation_space["eyes"], env.reset_infos


def steady(data, rng):
    """Start the episode in a fixed state that does not depend on the random generator."""
    data.mocap_pos[0, 1] = 0.4


@pytest.mark.parametrize("kelvins", [2000.0, 2500.0, 4000.0, 5000.0, 8000.0, 10_000.0])
def test_filtered_daylight_has_the_temperature_that_is_said(kelvins):
    """McCamy's approximation from CIE 1931 chromaticities (Color Res. Appl. 17, 1992) is independent of the filters.
    Daylight is not a black body, so filtered light deviates slightly: 7 mired are hardly visible.
    """
    light = daylight(NM * 1e-9) * filter_to(kelvins, NM * 1e-9)
    x, y, z = light @ cie_1931(NM * 1e-9)
    n = (x / (x + y + z) - 0.3320) / (0.1858 - y / (x + y + z))
    found = 449 * n**3 + 3525 * n**2 + 6823.3 * n + 5520.33
    assert 1e6 / found == pytest.approx(1e6 / kelvins, abs=7)
    assert y == pytest.approx(daylight(NM * 1e-9) @ cie_1931(NM * 1e-9)[:, 1], rel=1e-6)
    assert filter_to(DAYLIGHT, NM * 1e-9) == pytest.approx(np.ones(len(NM)))


@pytest.mark.parametrize("kelvins", [2500.0, 10_000.0])
def test_eyes_see_what_a_lamp_of_that_spectrum_shows(monkeypatch, kelvins):
    """The lamp's spectrum is measured and takes another path: through the mirror's emitters and the bands' means."""
    monkeypatch.setattr(Lit, "reset", lambda self, data, rng: steady(data, rng))
    warm = first_look(Lit(color_temperature=(kelvins, kelvins)), n=1)[0]
    lamp = Lit()
    spectrum = daylight(NM * 1e-9) * filter_to(kelvins, NM * 1e-9)
    lamp.spectra = {"sun": optics.Spectrum(tuple(NM), tuple(spectrum))}
    measured = first_look(lamp, n=1)[0]
    luminance = [level @ cie_1931(NM * 1e-9)[:, 1] for level in (spectrum, daylight(NM * 1e-9))]
    plain = first_look(Lit(), n=1)[0]
    assert luminance[0] == pytest.approx(luminance[1])
    # The model's colour sets the brightness of a measured lamp, whatever the unit of its table, so only colours are
    # compared.
    bright = plain[0, 0, 0].sum(axis=0) > 0.1
    ratios = [seen[0, 0, 0][[0, 2]][:, bright] / seen[0, 0, 0, 1][bright] for seen in (warm, measured, plain)]
    np.testing.assert_allclose(ratios[0], ratios[1], rtol=0.02)
    assert np.abs(ratios[0] / ratios[2] - 1).min() > 0.1


def test_signals_are_as_bright_as_lights(monkeypatch):
    monkeypatch.setattr(Lit, "reset", lambda self, data, rng: steady(data, rng))
    plain, _, space, _ = first_look(Lit())
    lit, varied, wider, infos = first_look(Lit(light=(0.1, 10.0)))
    np.testing.assert_allclose(lit, plain * varied["light"][:, None, None, None, None, None], rtol=1e-5, atol=1e-7)
    assert np.ptp(varied["light"]) > 0.5
    assert [info["varied"]["light"] for info in infos] == varied["light"].tolist()
    assert wider.high.max() == pytest.approx(10 * space.high.max())


def test_both_at_once_are_the_product(monkeypatch):
    monkeypatch.setattr(Lit, "reset", lambda self, data, rng: steady(data, rng))
    one = first_look(Lit(light=(3.0, 3.0), color_temperature=(3000.0, 3000.0)), n=1)[0]
    other = first_look(Lit(color_temperature=(3000.0, 3000.0)), n=1)[0]
    np.testing.assert_allclose(one, 3 * other, rtol=1e-5, atol=1e-7)


def test_draws_are_even_over_what_is_said():
    variation, random = (
        Variation({"light": (0.1, 10.0), "color_temperature": (2500.0, 10_000.0)}),
        np.random.default_rng(0),
    )
    drawn = [variation.draw(random) for _ in range(2000)]
    shares = (np.log10([one["light"] for one in drawn]) + 1) / 2
    mired = 1e6 / np.array([one["color_temperature"] for one in drawn])
    for even in (shares, (mired - 100) / 300):
        assert even.min() >= 0
        assert even.max() <= 1
        assert kstest(even, "uniform").pvalue > 1e-3
    assert abs(np.corrcoef(shares, mired)[0, 1]) < 0.1


def test_worlds_differ_by_seed_and_number_and_from_episode_to_episode():
    def lights(n, seed):
        env = sim.make_vec_env(Lit(light=(0.1, 1.0)), n_envs=n, seed=seed)
        env.reset()
        found = []
        for _ in range(7):
            found.append(env.simulation.varied["light"][0])
            env.step(np.zeros((n, 1)))
        return found

    first = lights(1, 3)
    assert first == lights(3, 3)
    assert first != lights(1, 4)
    assert len(set(first)) == 3
    assert first[0] == first[2] != first[3] == first[5]


def test_worlds_that_go_back_are_lit_as_they_were():
    env = sim.make_vec_env(Lit(light=(0.1, 1.0), color_temperature=(2500, 9000)), n_envs=3)
    env.reset()
    env.step(np.zeros((3, 1)))
    state, lit = env.get_state(), {name: values.copy() for name, values in env.simulation.varied.items()}
    then = [env.step(np.zeros((3, 1)))[0]["eyes"] for _ in range(5)]
    env.set_state(state, [0, 2])
    assert all(env.simulation.varied[name][2] == lit[name][2] for name in lit)
    for expected in then:
        np.testing.assert_array_equal(env.step(np.zeros((3, 1)))[0]["eyes"][[0, 2]], expected[[0, 2]])


@pytest.mark.parametrize("how", ["rays", "edges", "pupil"])
def test_bands_are_told_apart_however_rays_are_summed(how):
    eye = optics.Eye(resolution=(6, 6), fov_deg=60, bands=4, noise_sigma=0.0)
    if how == "pupil":
        eye = replace(eye, pupil=optics.Pupil(20e-6, thin_lens_focal_length=240e-6))
    fidelity = sim.Fidelity(64, bands=4, samples="edges") if how == "edges" else sim.Fidelity(4, bands=4)
    model = mujoco.MjModel.from_xml_string(SUN)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    renderer = sim.ModelRenderer(model, eye, Lit.mounts, 2, fidelity)
    plain = renderer.signals([data, data])
    parts = [renderer.signals([data, data], np.eye(4)[[k, k]] * [[1], [2]]) for k in range(4)]
    most = plain.max()
    np.testing.assert_allclose(sum(parts)[0], plain[0], rtol=1e-4, atol=1e-6 * most)
    np.testing.assert_allclose(sum(parts)[1], 2 * plain[0], rtol=1e-4, atol=1e-6 * most)
    assert all(part.max() > 0.01 * most for part in parts)
    with pytest.raises(ValueError, match=r"light has shape \(2, 3\): must be \(env, band\), \(2, 4\)"):
        renderer.signals([data, data], np.ones((2, 3)))


def test_brighter_worlds_are_looked_at_more_finely():
    def rays(**vary):
        task = Lit(**vary)
        task.fidelity, task.eye = "auto", optics.Eye(resolution=(2, 16), fov_deg=120, bands=4, noise_sigma=0.1)
        (found,) = fidelities_of(task).values()
        return found.rays_per_receptor

    assert rays(light=(0.1, 20.0)) > rays() == rays(light=(0.1, 0.2))


@pytest.mark.parametrize(
    ("vary", "said"),
    [
        ({"lihgt": (1, 2)}, "vary: 'lihgt'.*light"),
        ({"size": (1, 2)}, "vary: 'size': must be one of light, color_temperature"),
        ({"light": (2, 1)}, r"vary: light = \(2, 1\): must be \(low, high\), low first"),
        ({"ball.sise": (1, 2)}, "vary: 'ball.sise'; did you mean 'ball.size'?"),
        ({"ball.size": ((1, 1, 1), (2, 2, 2))}, r"vary: ball.size = .*: must be \(low, high\), factors, within"),
        ({"ball.color": (0, 1)}, r"vary: ball.color = \(0, 1\): must be \(\(red, green, blue\), .* within \[0, 1\]"),
        ({"ball.color": ((0, 0, 0), (1, 1, 2))}, "vary: ball.color = .*: must be"),
        ({"ball.start": ((0, 0), (1, 1))}, "vary: ball.start = .*: must be .* numbers or points"),
        ({"light": (0, 1)}, r"vary: light = \(0, 1\): must be"),
        ({"light": 3}, "vary: light = 3: must be"),
        ({"light": ("a", "b")}, "vary: light = .*: must be"),
        ({"light": (1, float("nan"))}, "vary: light = .*: must be"),
        ({"color_temperature": (10, 5000)}, r"vary: color_temperature = \(10, 5000\): must be .* \[1000, 40000\]"),
    ],
)
def test_bad_ranges_are_refused(vary, said):
    with pytest.raises(ValueError, match=said):
        sim.make_vec_env(Lit(**vary), n_envs=1)


def test_ranges_have_names():
    task = Lit()
    task.vary = [("light", (1, 2))]
    with pytest.raises(ValueError, match=r"vary = .*: must be ranges by name, such as {'light'"):
        sim.make_vec_env(task, n_envs=1)
