"""Predicted times of `propagate` against measured CPU times."""

import time

import numpy as np
import pytest

import optics


def random_passage(rng):
    """Return a random field, and settings for its propagation to a window of another size, pitch and centre."""
    n, m = (int(2 ** rng.uniform(6, 9.5)) for _ in range(2))
    dx, side = 10 ** rng.uniform(-6, -5), np.arange(n) - n // 2
    settings = {
        "dx": dx,
        "wavelength": 500e-9,
        "distance": (n * dx / 2) ** 2 / (500e-9 * 10 ** rng.uniform(-1.5, 1.5)),
        "out_dx": float(dx * rng.choice([1, 2, rng.uniform(0.3, 3)])),
        "out_shape": (m, m),
        "out_centre": tuple(rng.choice([0, 1]) * rng.normal(0, n * dx, 2)),
        "tolerance": float(10 ** rng.uniform(-4, -2)),
        "dtype": str(rng.choice(["float32", "float64"])),
    }
    return np.exp(-np.add.outer(side**2, side**2) / (n / 5) ** 2), settings


@pytest.mark.slow
def test_predicted_times_are_right_within_a_factor_of_two():
    """Each distance is new, because transfer functions and kernels are cached."""
    rng, ratios = np.random.default_rng(3), []
    while len(ratios) < 24:
        u, settings = random_passage(rng)
        measured = []
        try:
            predicted = optics.propagate(u, **settings).plan.seconds
            for change in (1, 2, 3):
                other = settings | {"distance": settings["distance"] * (1 + 1e-6 * change)}
                start = time.process_time()
                optics.propagate(u, **other)
                measured.append(time.process_time() - start)
        except optics.AccuracyError:
            continue
        ratios.append(np.median(measured) / predicted)
    assert np.median(np.abs(np.log2(ratios))) < 1, ratios
    assert np.mean(np.abs(np.log2(ratios)) < 1.5) > 0.8, ratios
