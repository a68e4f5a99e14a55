"""Costs of an animal's eyes and brain, which are subtracted from the animal's task fitness."""

from __future__ import annotations

from dataclasses import dataclass

from evolve.genome.eye_config import EyeConfig, setting
from evolve.genome.interval import Interval
from evolve.genome.phenotype import Phenotype
from optics.spectra.receptors import receptors_of

__all__ = ["CostsConfig", "neuron_count", "receptor_count"]

# A failed candidate has a fitness of -1e9 (`evolve.search.search.LOWEST`). The largest animal has 5e5 receptors.
PRICES = Interval(0, 1000)


@dataclass(frozen=True)
class CostsConfig:
    """Prices in units of fitness. The search maximises task fitness minus costs.

    `RunConfig` checks the values, and `evolve config schema` describes each field.
    """

    per_receptor: float = setting(
        0.0, PRICES, "price of a receptor; a position with several receptor types has one receptor of each type"
    )
    per_eye: float = setting(0.0, PRICES, "price of an eye, in addition to that of its receptors")
    per_neuron: float = setting(0.0, PRICES, "price of a hidden neuron of the brain: layers x neurons")

    @property
    def free(self) -> bool:
        """True if all prices are 0."""
        return self == CostsConfig()

    def total(self, animal: Phenotype, eye: EyeConfig) -> float:
        """Return the costs of an animal, in units of fitness."""
        receptors, neurons = receptor_count(animal, eye), neuron_count(animal)
        return self.per_receptor * receptors + self.per_eye * animal.n_eyes + self.per_neuron * neurons


def receptor_count(animal: Phenotype, eye: EyeConfig) -> int:
    """Return the number of receptors in all eyes of an animal, each receptor type counted separately.

    Without motion detectors, this is also the number of signals that the eyes deliver at a time.
    """
    rows, columns = animal.resolution
    types = eye.receptors if animal.lambda_max_nm is None else animal.lambda_max_nm
    return animal.n_eyes * rows * columns * receptors_of(types).channels


def neuron_count(animal: Phenotype) -> int:
    """Return the number of neurons for which an animal pays `costs.per_neuron`.

    These are the neurons in the hidden layers of the actor, the network that chooses actions. The neurons of the critic
    cost nothing, because only training uses them. The neurons of the encoders, which process the signals of the eyes,
    cost nothing, because they belong to the eyes, whose price is `costs.per_eye`.
    """
    return animal.layers * animal.neurons
