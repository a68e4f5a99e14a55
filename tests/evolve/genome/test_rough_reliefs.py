"""Every phenotype has kernels, however rough its relief is."""

from itertools import product

import numpy as np
import pytest

from evolve.config.assemble import assemble
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop

OPEN = ("genome.aperture_shape.open=true", "genome.dispersion.open=true")


@pytest.mark.slow
@pytest.mark.parametrize(("points", "symmetric"), product((4, 6, 8, 9), (False, True)))
def test_every_phenotype_has_receptive_fields(points, symmetric):
    from sim.eyes.receptive_fields import receptive_fields_of

    sizes = f"eye.relief_points={points}", f"eye.relief_symmetric={str(symmetric).lower()}"
    config, random = assemble("detection", assignments=[*sizes, *OPEN]), np.random.default_rng(points)
    for _ in range(2):  # of 8 or more points, all of 20 were refused before rough reliefs had kernels
        animal = develop(random.random(Genotype(config.genome).dimension), config)
        fields = receptive_fields_of(animal.eyes(config.eye).eye())
        assert ((fields.power > 0) & (fields.power <= 1)).all()
