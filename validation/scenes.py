"""What agents see on their way: worlds, eyes behind lenses in focus, and states that agents got into."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import optics
import sim
from sim.envs.simulation import Simulation
from sim.worlds.state import WorldState

__all__ = ["SCENES", "SIGMA", "Scene", "lived_through", "rms"]

SIGMA = 0.01


@dataclass(frozen=True)
class Scene:
    """A task's world, its eyes, and how wide their pupil is beside the retina."""

    task: str
    seed: int
    eyes: sim.Eyes
    aperture: float

    @property
    def name(self) -> str:
        height, width = self.eyes.resolution
        return f"{self.task}, {self.eyes.n_eyes} x ({height} x {width}), a = {self.aperture:g}"

    def behind_lens(self, bands: int) -> sim.Eyes:
        pupil = optics.Pupil(
            self.aperture * self.eyes.sensor_width / 2, thin_lens_focal_length=self.eyes.eye().sensor_distance
        )
        return replace(self.eyes, optics=pupil, bands=bands, noise_sigma=SIGMA)


TWO_EYES = sim.Eyes(n_eyes=2, resolution=(15, 15), fov_deg=45, placement_range_deg=60)
TEN_EYES = sim.Eyes(n_eyes=10, resolution=(1, 4), fov_deg=30, placement_range_deg=150)
SCENES = (
    Scene("detection", 0, TWO_EYES, 0.25),
    Scene("maze", 7, TEN_EYES, 0.25),
    Scene("tracking", 0, TWO_EYES, 0.5),
    Scene("maze", 12, TEN_EYES, 0.5),
)


def lived_through(world: sim.World, n: int, steps: int = 20) -> WorldState:
    """States that agents get into who act at random."""
    simulation = Simulation(world, n, 3, "training", 1)
    simulation.reset()
    rng = np.random.default_rng(5)
    for _ in range(steps):
        step = simulation.step(rng.uniform(-1, 1, (n, 2)))
        if step.done.any():
            simulation.restart(np.flatnonzero(step.done))
    simulation.close()
    return simulation.state


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
