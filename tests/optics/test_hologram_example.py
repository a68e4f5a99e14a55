"""The example of holograms agrees with a Fourier transform, and gradient descent makes the letter more uniform."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from rhabdom import optics

SCRIPT = Path(__file__).parents[2] / "examples" / "09_hologram.py"


@pytest.fixture(scope="module")
def example():
    return runpy.run_path(str(SCRIPT))


def test_image_of_a_plate_is_the_fourier_transform_of_its_pixels(example):
    """Paraxial rays give |Σ e^{iφ} e^{-2πi u·x}|² sinc² in the focal plane, where a delayed pixel has a positive phase.

    A plate with the opposite sign of the phase would give the image turned by half a turn."""
    turns = np.random.default_rng(3).random((32, 32))
    at = np.arange(32) - 15.5
    opening = optics.psf(example["plate"](0 * turns), [532e-9], example["FOCAL_LENGTH"], **example["view"](1)).psf[0]
    found = optics.psf(example["plate"](turns), [532e-9], example["FOCAL_LENGTH"], **example["view"](1)).psf[0]
    there = np.arange(25) - 12
    kernel = np.exp(-2j * np.pi * np.outer(there, at) / 32) * np.sinc(there / 32)[:, None]
    inside = np.hypot(at, at[:, None]) < 16  # pixels whose centre is open
    field = kernel @ (inside * np.exp(2j * np.pi * turns)) @ kernel.T
    wanted = np.abs(field) ** 2 * opening[12, 12] / inside.sum() ** 2
    assert np.linalg.norm(found - wanted) < 0.15 * np.linalg.norm(wanted), "the rim cuts pixels, 7 % of the amplitude"
    assert np.linalg.norm(found - wanted[::-1, ::-1]) > 0.5 * np.linalg.norm(wanted)


def test_gerchberg_saxton_sends_light_into_the_letter(example):
    first, better = (example["gerchberg_saxton"](steps, np.random.default_rng(0)) for steps in (1, 30))
    shares = [example["judged"](turns)[1] for turns in (first, better)]
    assert shares[1] > shares[0] + 0.04


def test_descent_makes_the_letter_more_uniform(example):
    before = example["defocus"]()
    (_, _, uneven), (_, share, spread) = (
        example["judged"](turns) for turns in (before, example["gradient_descent"](before, 30))
    )
    assert spread < 0.7 * uneven
    assert share > 0.4
