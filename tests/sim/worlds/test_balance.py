"""Goal and adversary are equally bright: a single receptor that covers a whole object cannot distinguish them."""

import numpy as np
import pytest

import sim
from sim.worlds import detection
from sim.worlds.state import WorldState

# [m] from the agent's centre; at shorter distances, an eye of 45° covers less and less of the object
DISTANCES = (2.0, 2.4, 3.0, 4.0, 6.0)
DIRECTIONS = np.arange(24) * 2 * np.pi / 24
EYE = sim.Eyes(n_eyes=1, resolution=(1, 1), fov_deg=45, noise_sigma=0.0)
NOISE = sim.Eyes().noise_sigma


def facing(kind):
    """Return states with an object of this kind straight ahead, in all directions and distances. The other objects are
    behind the agent.
    """
    distance, heading = (a.ravel() for a in np.meshgrid(DISTANCES, DIRECTIONS, indexing="ij"))
    n, ahead = len(heading), np.stack([np.cos(heading), np.sin(heading)], axis=1)
    objects = np.full((n, 3, 3), detection.OBJECT_RADIUS)
    objects[:, :, :2] = -30 * ahead[:, None]
    objects[:, kind, :2] = distance[:, None] * ahead
    none, still = np.zeros(n, int), np.zeros((n, 2))
    return WorldState(still, heading, still, objects, np.zeros((n, 3)), still, none, none, none)


def differences():
    """Return the signal of an adversary minus that of a goal, (distance, direction)."""
    world = sim.build_world("detection")
    renderer = sim.BatchedRenderer(world, EYE, len(DISTANCES) * len(DIRECTIONS), sim.Fidelity(1024, EYE.bands))
    goal, adversary = (renderer.signals(facing(kind))[:, 0, 0, 0, 0] for kind in (0, 1))
    return (adversary - goal).reshape(len(DISTANCES), -1)


def test_one_receptor_sees_goal_and_adversary_alike():
    """The difference is below a fifth of the receptors' noise in the mean over directions (measured: 0.13 at most).
    From any single direction it is below a third (measured: 0.23) if the whole object is visible. At 2 m, where the eye
    misses the top, it is 0.6, with a sign that depends on the sectors.
    """
    found = differences() / NOISE
    assert np.abs(found.mean(axis=1)).max() < 1 / 5
    assert np.abs(found[1:]).max() < 1 / 3


@pytest.mark.parametrize("bands", [4, 6])
def test_equally_wide_bands_would_give_adversaries_away(bands, monkeypatch):
    """Light from above falls on the upper bands, whatever their colour (measured: 1.6 and 1.1 times the noise)."""
    monkeypatch.setattr(detection, "BAND_EDGES_DEG", tuple(np.arange(1, bands) * 180 / bands))
    assert np.abs(differences()[0].mean()) > NOISE
