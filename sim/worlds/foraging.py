"""Foraging: an open walled field. The goal differs from the two adversaries only in its reflectance below 400 nm.

The field is the same as in the task "detection". All objects have the same vertical stripes. They are yellow, as many
flowers are. The goal also reflects ultraviolet, like many flowers that bees visit. The default RGB-like receptors
absorb no light below 400 nm. To them, goal and adversary are identical under any light and for any number of spectral
bands. (If the reflectances also differed in the visible range, goal and adversary could look the same to these
receptors only under certain lights, and for certain numbers of bands.)
"""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from optics.spectra.spectrum import LIMITS_NM, Spectrum
from sim.worlds import materials
from sim.worlds.detection import STRIPES, furnished_field
from sim.worlds.layout import Layout

DARK, BRIGHT = 0.05, 0.8  # reflectance of the yellow at the blue and at the red end of the visible range
EDGE_NM, WIDTH_NM = 510.0, 15.0  # position and width of the rise from DARK to BRIGHT
ULTRAVIOLET = {"goal": 0.6, "adversary": DARK}  # reflectance in the ultraviolet
# Below FULL_NM, the spectrum is the ultraviolet reflectance; above NONE_NM, it is the yellow; in between, a mixture.
FULL_NM, NONE_NM = 350.0, 400.0
STEP_NM = 5.0


def petal(ultraviolet: float) -> Spectrum:
    """Return a smooth, yellow reflectance spectrum, which equals `ultraviolet` up to 350 nm.

    At 400 nm and above, the spectrum does not depend on `ultraviolet`.
    """
    nm = np.arange(LIMITS_NM[0], LIMITS_NM[1] + STEP_NM / 2, STEP_NM)
    yellow = DARK + (BRIGHT - DARK) / (1 + np.exp((EDGE_NM - nm) / WIDTH_NM))
    way = np.clip((nm - FULL_NM) / (NONE_NM - FULL_NM), 0, 1)
    share = (1 + np.cos(np.pi * way)) / 2
    return Spectrum(tuple(nm), tuple(np.where(way < 1, share * ultraviolet + (1 - share) * yellow, yellow)))


def add_layout(spec: mujoco.MjSpec, rng: np.random.Generator) -> Layout:
    """Add the walled field, a goal and two adversaries. All three objects have vertical stripes; `rng` is not used."""
    spectra = {kind: petal(share) for kind, share in ULTRAVIOLET.items()}
    materials.add_texture(spec, "upright_stripes", materials.stripes((8, 512), 2 * STRIPES, axis=1))
    for kind, spectrum in spectra.items():
        materials.add_textured(spec, kind, "upright_stripes", color=materials.display_color(spectrum))
    return replace(furnished_field(spec), spectra=spectra)
