"""Choice of direct or bounced light: the root mean square over the receptors that bounced light reaches."""

import math

import numpy as np
import pytest

from sim.render.model_fidelity import SPLIT, _light
from sim.tracing import lighting

ALLOWED = 0.01


def level(reached, missing, receptors=10, allowed=ALLOWED):
    """Return the level of light that is chosen for receptors of three channels. In direct light, `reached` of them lack
    the signal `missing` in one channel.
    """
    bounce = np.full((1, 1, 3, 1, receptors), 0.5)
    bounce[:, :, 1, :, :reached] += missing
    bounce[:, :, 2, :, :reached] -= 0.3 * missing
    seen = {lighting.BOUNCE: bounce, lighting.DIRECT: np.full((1, 1, 3, 1, receptors), 0.5)}
    return _light("auto", seen.__getitem__, allowed)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_error_is_that_of_the_receptors_that_bounced_light_reaches(sign):
    """Nine of ten receptors without bounced light must not hide the error of the tenth."""
    found = level(1, sign * 0.5 * ALLOWED)
    assert (found.level, found.predicted_error) == (lighting.DIRECT, pytest.approx(0.5 * ALLOWED))
    assert level(1, sign * 1.5 * ALLOWED).level == lighting.BOUNCE
    assert (
        level(1, sign * 0.25, allowed=0.25).level == lighting.DIRECT
    )  # numbers without rounding; the limit is allowed


def test_the_root_mean_square_counts():
    """One receptor has 1.3 times the allowed error, and another one 0.5 times. Their root mean square is 0.985 times
    the allowed error.
    """
    bounce = np.zeros((1, 1, 3, 1, 2))
    bounce[..., 0, :, 0], bounce[..., 0, :, 1] = 1.3 * ALLOWED, 0.5 * ALLOWED
    found = _light("auto", {lighting.BOUNCE: bounce, lighting.DIRECT: np.zeros_like(bounce)}.__getitem__, ALLOWED)
    assert (found.level, found.predicted_error) == (
        lighting.DIRECT,
        pytest.approx(ALLOWED * math.hypot(1.3, 0.5) / math.sqrt(2)),
    )


def test_receptors_at_the_limit_of_a_uniform_field():
    above, below = level(5, 1.01 * SPLIT * ALLOWED), level(5, 0.99 * SPLIT * ALLOWED)
    assert above.predicted_error == pytest.approx(1.01 * SPLIT * ALLOWED)
    assert below.predicted_error == 0
    assert level(0, 1.0).level == lighting.DIRECT


@pytest.mark.parametrize("asked", [lighting.DIRECT, lighting.BOUNCE])
def test_a_level_that_is_requested_is_not_tried(asked):
    found = _light(asked, lambda light: pytest.fail("rendered"), ALLOWED)
    assert (found.level, found.predicted_error) == (asked, None)
