"""Kernels that `Eye.see` keeps, and the time that an eye may take to compute them."""

import pickle
import re
import sys
from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

import optics
from optics.eye import eye as module

PUPIL = optics.Pupil(20e-6, thin_lens_focal_length=150e-6)
SCENE = np.random.default_rng(1).random((1, 8, 8))


def an_eye(pupil=PUPIL, **changes):
    return optics.Eye(pupil, (4, 4), 60.0, sensor_width=200e-6, bands=1, **changes)


@pytest.fixture
def computed(monkeypatch):
    """Return a list to which the distances are added for which kernels are computed."""
    calls, compute = [], module.receptor_kernel

    def counted(eye, retina, z, *rest):
        calls.append(z)
        return compute(eye, retina, z, *rest)

    monkeypatch.setattr(module, "receptor_kernel", counted)
    return calls


def test_a_second_look_at_the_same_distances_computes_no_kernel(computed):
    eye, depth = an_eye(), np.linspace(0.001, 0.1, 64).reshape(8, 8)
    first = eye.see(SCENE, 2, z=depth)
    count = len(computed)
    assert count >= 2
    assert np.array_equal(eye.see(SCENE, 2, z=depth), first)
    turned = eye.see(SCENE, 2, z=depth[::-1])  # the same range of distances, in other places
    assert len(computed) == count
    assert not np.array_equal(turned, first)
    assert np.array_equal(an_eye().see(SCENE, 2, z=depth[::-1]), turned)


@pytest.mark.parametrize("other", [{"samples_per_receptor": 1}, {"z": 0.02}])
def test_other_kernels_are_computed(computed, other):
    eye = an_eye()
    eye.see(SCENE, 2)
    count = len(computed)
    asked = {"samples_per_receptor": 2, **other}
    seen = eye.see(SCENE, **asked) if asked["samples_per_receptor"] == 2 else eye.see(SCENE[:, :4, :4], 1)
    assert len(computed) > count
    fresh = an_eye().see(SCENE, **asked) if asked["samples_per_receptor"] == 2 else an_eye().see(SCENE[:, :4, :4], 1)
    assert np.array_equal(seen, fresh)


def test_a_call_of_another_thread_does_not_change_the_kernels():
    """Before each line of the function that stores kernels, the eye sees a scene at another distance, as it could in
    another thread.
    """
    eye, before = an_eye(), sys.gettrace()
    expected = an_eye().see(SCENE, 2, z=0.02)

    def meanwhile(frame, event, _):
        if frame.f_code is not optics.Eye._last_sight.__code__:
            return None
        if event == "line":
            sys.settrace(before)
            eye.see(SCENE, 2, z=0.001)
            sys.settrace(meanwhile)
        return meanwhile

    sys.settrace(meanwhile)
    try:
        seen = eye.see(SCENE, 2, z=0.02)
    finally:
        sys.settrace(before)
    assert np.array_equal(seen, expected)


def test_derivatives_are_computed_again(computed):
    """A graph of derivatives can be used for one backward pass only, so kernels with derivatives are not stored."""
    from drjit.auto.ad import Float

    radius = Float(20e-6)
    dr.enable_grad(radius)
    eye, found = an_eye(optics.Pupil(radius, thin_lens_focal_length=150e-6)), []
    for _ in range(2):
        dr.backward(dr.sum(eye.see(SCENE, 2).array))
        found.append(float(radius.grad[0]))
        radius.grad = 0
    assert len(computed) >= 2
    assert found[0] == pytest.approx(found[1], rel=1e-5)  # threads add float32 gradients in any order
    assert found[1] != 0


def test_an_eye_that_has_seen_can_be_pickled_and_changed():
    eye = an_eye()
    seen = eye.see(SCENE, 2)
    assert np.array_equal(pickle.loads(pickle.dumps(eye)).see(SCENE, 2), seen)
    other = replace(eye, pupil=optics.Pupil(10e-6, thin_lens_focal_length=150e-6)).see(SCENE, 2)
    assert not np.allclose(other, seen, rtol=1e-3)


def test_the_time_limit_can_be_raised():
    eye = an_eye(most_seconds=1e-5)
    for compute in (lambda: eye.kernel(2), eye.psf):
        with pytest.raises(optics.AccuracyError, match="limits are 4 GB and 1e-05 s") as refused:
            compute()
        allowed = re.search(r"; most_seconds=(\d+) allows the eye this time$", str(refused.value))
        assert allowed is not None
        assert replace(eye, most_seconds=float(allowed[1])).kernel(2).shape[0] == 1
    with pytest.raises(ValueError, match="most_seconds = 0: must be greater than 0"):
        an_eye(most_seconds=0)
