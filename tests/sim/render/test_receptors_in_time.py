"""Filters of receptors against closed forms: steps, sinusoids, shot noise, adaptation, events and motion detectors."""

import math

import numpy as np
import pytest

from optics import ReceptorDynamics
from sim.render.receptor_noise import NoiseModel
from sim.render.receptors_in_time import ReceptorsInTime

ONE = np.arange(1)
MS = 1e-3


def played(dynamics, signals, ms, before=0.0):
    """Responses to signals (frame, ...) in one world after a steady state, (frame, ...)."""
    signals = np.asarray(signals, np.float32)
    signals = signals.reshape(len(signals), 1, *(signals.shape[1:] or (1,)))
    receptors = ReceptorsInTime(dynamics, 1, signals.shape[2:], ms * MS)
    receptors.start(np.full_like(signals[0], before), ONE)
    return np.array([receptors.step(frame, ONE)[0] for frame in signals])


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("ms", [1.0, 7.0, 40.0])
def test_the_step_response_has_the_closed_form_for_frames_of_any_length(order, ms):
    tau, t = 12.0, ms * np.arange(1, 9)
    found = played(ReceptorDynamics(tau, order), np.ones(8), ms)[:, 0]
    x = t / tau
    assert found == pytest.approx(1 - np.exp(-x) * (1 if order == 1 else 1 + x), abs=1e-6)


@pytest.mark.parametrize("order", [1, 2])
def test_sinusoids_have_the_gain_and_phase_of_the_transfer_function(order):
    tau, ms, hz = 20.0, 0.1, 8.0
    omega = 2 * math.pi * hz * MS
    t = ms * np.arange(1, 15_001)
    found = played(ReceptorDynamics(tau, order), np.sin(omega * t), ms)[-10_000:, 0]
    spectrum = 2 * np.mean(found * np.exp(-1j * omega * t[-10_000:])) * 1j
    assert spectrum == pytest.approx((1 + 1j * omega * tau) ** -order, abs=4e-3)


def test_latency_delays_by_whole_frames():
    found = played(ReceptorDynamics(1e-3, latency_ms=21.0), [1, 2, 3, 4, 5], 10.0, before=9.0)[:, 0]
    assert found == pytest.approx([9, 9, 1, 2, 3])


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("ms", [2.0, 10.0])
def test_the_variance_of_filtered_shot_noise_depends_on_the_filter_and_not_on_the_frames(order, ms):
    """For short frames and N photons in the integration time Δt, the variance of a signal s is s Δt / N ∫h², where h is
    the impulse response.
    """
    tau, s, photons, integration = 30.0, 0.5, 400.0, 20.0
    dynamics = ReceptorDynamics(tau, order)
    shot, rest = NoiseModel(0.0, np.full((1,), photons)).in_frames(ms / integration)
    assert rest is None
    rng, receptors = np.random.default_rng(order), ReceptorsInTime(dynamics, 4000, (1,), ms * MS)
    everyone, light = np.arange(4000), np.full((4000, 1), s, np.float32)
    receptors.start(light, everyone)
    found = []
    for _ in range(int(10 * tau / ms)):
        out = receptors.step(shot(light, rng.standard_normal(light.shape).astype(np.float32)), everyone)
        found.append(out[:, 0])
    variance = np.var(np.array(found)[-20:], axis=1).mean()
    x = ms / tau
    step = 1 - math.exp(-x)
    exact = {1: step / (2 - step), 2: _sum_of_squares(x)}[order] * integration / ms
    assert variance * photons / s == pytest.approx(exact, rel=0.06)
    assert exact == pytest.approx(integration / dynamics.integration_ms, rel=0.03)
    assert np.mean(found[-1]) == pytest.approx(s, rel=0.01)


def _sum_of_squares(x):
    """Sum of the squares of the second filter's impulse response for frames of the length x τ."""
    edges = x * np.arange(4000)
    steps = 1 - np.exp(-edges) * (1 + edges)
    return np.square(np.diff(steps)).sum()


def test_naka_rushton_gives_a_half_in_constant_light_and_follows_the_quotient_after_a_step():
    dynamics = ReceptorDynamics(1e-3, adaptation="naka_rushton", adaptation_ms=500.0, dark_light=1e-6)
    steady = played(dynamics, np.ones(3), 10.0, before=1.0)[:, 0]
    assert steady == pytest.approx(0.5, abs=1e-5)
    jump = played(dynamics, np.full(400, 4.0), 10.0, before=1.0)[:, 0]
    assert jump[0] == pytest.approx(4 / 5, abs=1e-5)
    mean = 4 - 3 * np.exp(-0.02 * np.arange(400))  # of the mean before each frame
    assert jump == pytest.approx(4 / (4 + mean), abs=1e-5)


def test_logarithmic_adaptation_obeys_webers_law():
    dynamics = ReceptorDynamics(1e-3, adaptation="logarithmic", dark_light=1e-9)
    for background in (1e-3, 1.0):
        assert played(dynamics, [1.3 * background], 10.0, before=background)[0, 0] == pytest.approx(
            math.log(1.3), rel=1e-4
        )


def test_events_count_changes_of_the_logarithm():
    dynamics = ReceptorDynamics(1e-3, event_threshold=0.1, dark_light=1e-9)
    receptors = ReceptorsInTime(dynamics, 1, (1,), 0.01)
    receptors.start(np.ones((1, 1), np.float32), ONE)
    for factor in (1.2, 1.5):
        out = receptors.step(np.full((1, 1), factor, np.float32), ONE)
    assert out[0, 0] == 4  # ln 1.5 = 0.405, in two frames
    receptors.reset_counts(ONE)
    assert receptors.step(np.full((1, 1), 1.0, np.float32), ONE)[0, 0] == -4
    assert receptors.step(np.full((1, 1), 1.0, np.float32), ONE)[0, 0] == -4  # not observed yet


def moving(detector, velocity, period=8.0, tau=40.0, ms=1.0, contrast=1.0):
    """Return the mean output of detectors that see a grating, which moves to the right at this velocity
    [receptors/s].
    """
    dynamics = ReceptorDynamics(1e-3, motion=detector, motion_ms=tau)
    cycle = 1e3 * period / abs(velocity) / ms
    t = ms * np.arange(int(math.ceil(12 * tau / ms / cycle + 4) * cycle)) * MS
    grating = 1 + contrast * np.sin(2 * np.pi * (np.arange(9) - velocity * t[:, None]) / period)
    found = played(dynamics, grating[:, None, None, None], ms)[-int(2 * cycle) :, 0]
    assert found.shape[1] == 2  # the detectors follow the receptor's channel
    return found[:, 1, 0, :-1].mean()


def test_reichardt_detectors_have_the_closed_form_of_their_velocity_tuning():
    """<R> = C² sin(2π/λ) ωτ / (1 + ω²τ²), for a grating of contrast C and wavelength λ (Borst & Egelhaaf 1989)."""
    period, tau = 8.0, 0.04
    for velocity in (5.0, 8 / (2 * math.pi * tau), 100.0, -20.0):
        omega = 2 * math.pi * velocity / period
        expected = math.sin(2 * math.pi / period) * omega * tau / (1 + (omega * tau) ** 2)
        assert moving("hassenstein_reichardt", velocity, period) == pytest.approx(expected, abs=0.012)
    # The optimum is a temporal frequency, 1/(2πτ), and not a velocity.
    responses = [moving("hassenstein_reichardt", v, 16.0) for v in (20.0, 64.0, 200.0)]
    assert responses[1] == max(responses)
    half = moving("hassenstein_reichardt", 20.0, contrast=0.5) / moving("hassenstein_reichardt", 20.0)
    assert half == pytest.approx(0.25, rel=0.05)


@pytest.mark.parametrize("detector", ["hassenstein_reichardt", "barlow_levick"])
def test_detectors_are_selective_for_the_direction(detector):
    right, left = moving(detector, 30.0), moving(detector, -30.0)
    assert right > 0.05
    assert left == pytest.approx(-right, rel=0.1)


@pytest.mark.parametrize("detector", ["hassenstein_reichardt", "barlow_levick"])
def test_detectors_are_silent_in_constant_and_uniform_light(detector):
    dynamics = ReceptorDynamics(5.0, motion=detector)
    light = np.ones((4, 1, 1, 1, 5))
    still = played(dynamics, 0.7 * light, 10.0, before=0.7)
    flicker = played(dynamics, np.array([0.1, 1, 0.2, 0.9]).reshape(4, 1, 1, 1, 1) * light, 10.0)
    assert np.abs(flicker[:, 0, 0]).max() > 0.1
    assert np.abs(still[:, 0, 1]).max() < 1e-6
    assert np.abs(flicker[:, 0, 1]).max() < 1e-6


def test_a_latency_that_needs_too_many_frames_is_refused():
    with pytest.raises(ValueError, match=r"latency_ms = 10000: must be at most 1000 frames of 1 ms"):
        ReceptorsInTime(ReceptorDynamics(latency_ms=1e4), 1, (1,), 1e-3)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"time_constant_ms": 0.0}, r"time_constant_ms = 0.*must lie in"),
        ({"order": 3}, "order = 3"),
        ({"latency_ms": -1.0}, "latency_ms"),
        ({"adaptation": "fast"}, "adaptation = 'fast'"),
        ({"motion": "reichardt"}, "motion = 'reichardt'"),
        ({"event_threshold": 0.0}, "event_threshold"),
        ({"event_threshold": 0.1, "adaptation": "naka_rushton"}, "must be None with adaptation"),
        ({"frames": 0}, "frames = 0"),
    ],
)
def test_bad_dynamics_are_refused_in_one_line(given, message):
    with pytest.raises(ValueError, match=message) as raised:
        ReceptorDynamics(**given)
    assert "\n" not in str(raised.value)
