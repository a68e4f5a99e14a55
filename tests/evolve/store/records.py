"""Candidates in closed form for tests of the record."""

import math

import numpy as np

from evolve.config.numbering import Place
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.store.candidate import Candidate
from evolve.store.evaluation import Evaluation
from tests.evolve.closed_form import tiny

CONFIG = tiny()
NOBODY = 999_999_999  # no process has this number: systems use numbers up to 4,194,304
DIMENSION = Genotype(CONFIG.genome).dimension


def candidate(identity, fitness=1.0, failure=None):
    genome = np.random.default_rng(identity).random(DIMENSION)
    outcome = Evaluation(fitness, (fitness, 1 / 3), 0.5, 4096, 0.1, ((2048, 0.1), (4096, math.pi)), failure)
    return Candidate.from_evaluation(
        Place.from_id(identity, 4), tuple(genome.tolist()), develop(genome, CONFIG), 2**32 - 1 - identity, outcome
    )
