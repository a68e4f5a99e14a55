"""The number of rays for eyes on a model: judged by receptors that see an edge, with a known error, and for states
outside the trials.
"""

import warnings

import mujoco
import numpy as np
import pytest

import optics
import sim
from sim.render.fidelity_choice import FidelityWarning
from sim.render.model_fidelity import tried
from tests.sim.envs.test_task_vec_env import Face

BALL = mujoco.MjModel.from_xml_string("""
    <mujoco><visual><headlight active="0"/></visual><worldbody>
      <light type="directional" dir=".2 .3 -1" diffuse=".9 .9 .9"/>
      <body name="head"><geom size=".1" rgba="0 0 0 1"/></body>
      <body name="ball" mocap="true" pos="3 0 0"><geom size=".4" rgba="1 1 1 1" contype="0" conaffinity="0"/></body>
    </worldbody></mujoco>""")
MOUNT = sim.Mount("head", offset=(0.2, 0, 0))


def moments(seed, n=6, aside=0.7):
    """Return states with the ball at random positions, at most this far aside."""
    random, datas = np.random.default_rng(seed), []
    for _ in range(n):
        data = mujoco.MjData(BALL)
        data.mocap_pos[0] = random.uniform(2.5, 4), *random.uniform(-aside, aside, 2)
        mujoco.mj_forward(BALL, data)
        datas.append(data)
    return datas


def eye(**changes):
    return optics.Eye(**{"resolution": (9, 9), "fov_deg": 50, "bands": 2, **changes})


def signals(rays, datas, one):
    renderer = sim.ModelRenderer(BALL, one, [MOUNT], len(datas), sim.Fidelity(rays, bands=one.bands))
    return renderer.signals(datas)


def known_error(power, share, receptors=1000):
    """Return a function for the signals of an object that a `share` of the receptors see, with an error of 0.1
    rays^-power.
    """
    saw = np.arange(receptors) < share * receptors
    return lambda rays: (0.0 if rays >= 1e6 else 0.1 * rays**-power) * saw.reshape(1, 1, 1, 1, -1)


def test_the_error_is_that_of_who_sees_something():
    """The mean over all receptors would be a tenth of this error, so that 1 ray would suffice."""
    for share in (1.0, 0.01):
        trials = tried(known_error(0.75, share), (1, 4, 16, 64), 1e6, 0.02)
        assert trials.errors == pytest.approx({1: 0.1, 4: 0.1 * 4**-0.75, 16: 0.0125})
        assert trials.share == pytest.approx(share)


def test_nothing_to_tell_apart_takes_the_fewest():
    trials = tried(lambda rays: np.full((2, 1, 3, 4, 4), 0.3), (1, 4), 100, 0.01)
    assert (dict(trials.errors), trials.share) == ({1: 0.0}, 0.0)


def test_the_promise_holds_at_moments_that_were_not_tried():
    one = eye(noise_sigma=0.05)
    chosen = sim.choose_model_fidelity(BALL, one, [MOUNT], moments(0))
    held_out = moments(1, 12)
    right = signals(2048, held_out, one)
    coarse, off = (np.abs(signals(rays, held_out, one) - right).max(axis=2) for rays in (1, chosen.rays_per_receptor))
    apart = coarse > 0.1 * chosen.tolerance
    error = np.sqrt(np.square(off[apart]).mean())
    # Six states of one ball predict the error of twelve others; a third more is their scatter.
    assert error < 1.33 * chosen.tolerance
    assert error == pytest.approx(chosen.predicted_error, rel=0.5)
    fewer = np.abs(signals(chosen.rays_per_receptor / 2, held_out, one) - right).max(axis=2)
    assert np.sqrt(np.square(fewer[apart]).mean()) > chosen.tolerance / 1.33, "half of the rays is not enough"
    assert chosen.tolerance == 0.5 * one.noise_sigma


def test_errors_fall_as_stratified_rays_have_it():
    """The error of an edge through a square of n jittered cells falls as n^-3/4 (Mitchell 1996, section 3)."""
    datas, one = moments(2), eye()
    trials = tried(lambda rays: signals(rays, datas, one), (1, 4, 16, 64), 1024, 1e-9)
    slope = np.polyfit(np.log(list(trials.errors)), np.log(list(trials.errors.values())), 1)[0]
    assert -0.95 < slope < -0.55


def test_more_noise_wants_fewer_rays():
    rays = [
        sim.choose_model_fidelity(BALL, eye(noise_sigma=sigma), [MOUNT], moments(0)).rays_per_receptor
        for sigma in (0.01, 0.04, 0.2)
    ]
    assert rays == sorted(rays, reverse=True)
    assert rays[0] > rays[2]


def test_perfect_lenses_trace_many_rays_at_edges_alone():
    one = eye(noise_sigma=0.01)
    many, few = (sim.choose_model_fidelity(BALL, one, [MOUNT], moments(0), tolerance) for tolerance in (0.01, 0.1))
    assert (many.samples, few.samples) == ("edges", "rays")
    assert many.rays_per_receptor >= 16 > few.rays_per_receptor


def test_behind_a_pupil_receptors_share_rays():
    blurred = eye(pupil=optics.Pupil(20e-6, thin_lens_focal_length=240e-6))
    shared = sim.choose_model_fidelity(BALL, blurred, [MOUNT], moments(0))
    assert shared.rays_per_receptor < sim.choose_model_fidelity(BALL, eye(), [MOUNT], moments(0)).rays_per_receptor


def test_what_cannot_be_promised_is_said():
    with pytest.warns(FidelityWarning, match="times the allowed 1.0e-05, mostly from (edges|rays): 256 per receptor"):
        chosen = sim.choose_model_fidelity(BALL, eye(), [MOUNT], moments(0), tolerance=1e-5)
    assert chosen.rays_per_receptor == 256
    for tolerance in (0, -1, np.nan, np.inf):
        with pytest.raises(ValueError, match=r"tolerance = .*: must be positive"):
            sim.choose_model_fidelity(BALL, eye(), [MOUNT], moments(0), tolerance=tolerance)


class Auto(Face):
    fidelity = "auto"
    eye = optics.Eye(resolution=(2, 8), fov_deg=120, bands=4, noise_sigma=0.05)


class Wrong(Face):
    fidelity = "fine"


def test_a_task_that_does_not_say_is_tried():
    found = [sim.make_vec_env(Auto(), n_envs=n, seed=n).renderer.fidelity for n in (1, 3)]
    assert found[0] == found[1], "the same in every environment of the task"
    assert found[0].predicted_error <= found[0].tolerance == pytest.approx(0.025)
    assert "at 12 moments" in found[0].why
    with pytest.raises(ValueError, match=r"Wrong: fidelity = 'fine': must be a sim\.Fidelity, or 'auto'"):
        sim.make_vec_env(Wrong(), n_envs=1)


def test_what_eyes_do_not_see_is_told_once():
    class Dim(Auto):
        model = Face.model.replace('active="0"', 'ambient=".3 .3 .3" diffuse="0 0 0"')

    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        sim.make_vec_env(Dim(), n_envs=1)
    assert sum(issubclass(one.category, sim.MirrorWarning) for one in told) == 1
