"""Masked elements (numpy.ma) are refused by name where arrays enter environments, tasks, mirrors and genomes."""

import numpy as np
import pytest

import evolve
import sim
from optics.eye.photoreceptor import gaussian_noise, photon_noise
from optics.spectra.bands import SpectralBands
from optics.spectra.spectrum import daylight
from sim.envs import held_state
from sim.envs.parallel_env import EncounterEnv
from sim.scene.cameras import Viewpoint
from sim.scene.rays import checked_wavelengths
from sim.scene.variation import Variation
from sim.tasks.batch_arrays import columns, rows
from tests.odd_arguments import masked
from tests.sim.envs.hunt import Prey

RNG = np.random.default_rng(0)
SOME = masked(np.array([450e-9, 550e-9, 650e-9]), RNG)
GENES = evolve.Genotype(evolve.RunConfig("detection").genome)
ENTRIES = {
    "wavelengths": lambda: checked_wavelengths(SOME),
    "daylight": lambda: daylight(SOME),
    "vary": lambda: Variation({"light": np.ma.masked_array([0.5, 2.0], [True, False])}),
    "rewards": lambda: rows("rewards", SOME, 3, float),
    "proprioception": lambda: columns("proprioception", masked(np.ones((2, 3)), RNG), 2),
    "origin": lambda: Viewpoint.looking_at(SOME, np.zeros(3)),
    "target": lambda: Viewpoint.looking_at(np.ones(3), SOME),
    "signal": lambda: gaussian_noise(masked(np.ones((1, 2, 2)), RNG), 0.1, RNG),
    "photons": lambda: photon_noise(np.ones((3, 2, 2)), SOME, RNG),
    "radiance": lambda: SpectralBands.uniform(3).band_values(lambda at: masked(np.ones(at.shape), RNG), "rgb"),
    "state": lambda: held_state.checked({"steps": masked(np.ones(2), RNG)}, {"steps": np.ones(2)}),
    "worlds": lambda: held_state.chosen_worlds(masked(np.array([0, 1]), RNG), 2),
    "genome": lambda: GENES.decode(masked(np.full(GENES.dimension, 0.5), RNG)),
}


@pytest.mark.parametrize("name", ENTRIES)
def test_entries_name_masked_arrays(name):
    with pytest.raises(ValueError, match=r"has masked elements: must be without them"):
        ENTRIES[name]()


class Reporting(Prey):
    def proprioception(self, data):
        return masked(np.ones(3), RNG)


def test_tasks_and_animals_of_one_world():
    with pytest.raises(RuntimeError, match=r"^proprioception has masked elements"):
        sim.make_env(Reporting())


def test_actions():
    env = sim.make_vec_env(Prey(), n_envs=2)
    env.reset()
    with pytest.raises(ValueError, match="actions has masked elements"):
        env.step_async(masked(np.zeros((2, *env.action_space.shape), np.float32), RNG))
    several = EncounterEnv.__new__(EncounterEnv)  # without its renderer
    several.agents, several.action_spaces = ["prey"], {"prey": env.action_space}
    with pytest.raises(ValueError, match=r"action of 'prey' has masked elements"):
        several._commanded({"prey": masked(np.zeros(env.action_space.shape), RNG)})
    env.close()
