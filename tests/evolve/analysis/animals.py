"""Animals of the tests."""

import numpy as np

from evolve.genome.phenotype import Phenotype


def phenotype(**changes):
    """Return an animal with three eyes, with changes."""
    values = {
        "n_eyes": 3,
        "placement_range_deg": 90.0,
        "fov_deg": 45.0,
        "resolution": (2, 15),
        "relative_aperture": 0.5,
        "relief": tuple(np.linspace(0, 1, 16)),
        "refractive_index": 1.5,
        "memory_frames": 4,
        "neurons": 64,
    }
    return Phenotype(**{**values, **changes})
