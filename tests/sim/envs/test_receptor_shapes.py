"""Eyes with receptors of any shape in user tasks: a receptor sees the mean of the square receptors that it covers."""

from dataclasses import replace

import numpy as np
import pytest

import optics
import sim
from tests.sim.envs.rooms import Room

SIDE, FOV = 12, 60.0  # rows, columns and fields of view [degrees] of the eye with square receptors
LENS = optics.Pupil(60e-6, thin_lens_focal_length=180e-6)
RAYS = 16  # per square receptor, in all eyes
SQUARE = optics.Eye(resolution=(SIDE, SIDE), fov_deg=FOV, bands=3, noise_sigma=0.0)
# Rows and columns of the receptors, whose ratios of height to width are 12, 4, 1.5, 2/3, 1/4 and 1/12.
SHAPES = ((1, 12), (3, 12), (4, 6), (6, 4), (12, 3), (12, 1))


def seen(eye, worlds=2):
    """Return the signals of one eye at the start of episodes, (world, channel, y, x)."""
    task = Room()
    task.eye, rows, columns = eye, *eye.resolution
    task.fidelity = sim.Fidelity(RAYS * SIDE**2 // (rows * columns), bands=eye.bands)
    task.mounts = (sim.Mount("cart", offset=(0.2, 0, 0.1), elevation_deg=-10),)
    env = sim.make_vec_env(task, n_envs=worlds, seed=4)
    try:
        return env.reset()["eyes"][:, -1, 0]
    finally:
        env.close()


def means(signals, rows, columns):
    """Return the means over equal blocks of receptors."""
    return signals.reshape(*signals.shape[:2], rows, SIDE // rows, columns, SIDE // columns).mean(axis=(3, 5))


@pytest.fixture(scope="module")
def squares():
    return {pupil: seen(replace(SQUARE, pupil=pupil)) for pupil in (None, LENS)}


# Rays scatter at edges: errors fall by half with four times the rays. Behind a lens, edges are blurred.
@pytest.mark.fast_cases(6)
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("pupil", "allowed"), [(None, 0.05), (LENS, 0.01)])
def test_receptors_see_the_mean_of_the_squares_that_they_cover(pupil, allowed, shape, squares):
    eye = replace(SQUARE, resolution=shape, vertical_fov_deg=FOV, pupil=pupil)
    found, expected = seen(eye), means(squares[pupil], *shape)
    assert np.ptp(expected) > 0.4 * expected.mean(), "the scene must not be uniform"
    error = np.sqrt(np.mean((found - expected) ** 2))
    assert error < allowed * expected.mean()
    square_receptors = seen(replace(eye, vertical_fov_deg=None))  # they span another vertical field
    assert np.sqrt(np.mean((square_receptors - expected) ** 2)) > 4 * error


def test_automatic_fidelity_serves_any_shape():
    """The number of rays is chosen for the receptors of the eye, whatever their shape."""
    task = Room()
    task.eye = replace(SQUARE, resolution=(2, 8), vertical_fov_deg=100.0, noise_sigma=0.05)
    task.fidelity = "auto"
    env = sim.make_vec_env(task, n_envs=1, seed=4)
    assert env.reset()["eyes"].shape == (1, 1, 1, 3, 2, 8)
    env.close()
