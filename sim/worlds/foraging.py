"""Foraging: the field of detection, with objects of one pattern that differ only in what they reflect below 400 nm.

All are yellow, as many flowers are; the goal reflects ultraviolet too, as those that bees visit often do. The default
RGB-like receptors take no light below 400 nm: to them, both are the same under any light and by any number of bands.
(Spectra that differed in the visible, too, could be metamers for one light and one number of bands at a time only.)
"""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from optics.spectra.spectrum import LIMITS_NM, Spectrum
from sim.worlds import materials
from sim.worlds.detection import STRIPES, furnished_field
from sim.worlds.layout import Layout

DARK, BRIGHT = 0.05, 0.8  # reflectance of yellow at either end of the visible range
EDGE_NM, WIDTH_NM = 510.0, 15.0  # where and how fast it rises
ULTRAVIOLET = {"goal": 0.6, "adversary": DARK}  # reflectance in the ultraviolet
FULL_NM, NONE_NM = 350.0, 400.0  # below, it reflects as much as that; above, it is yellow alone
STEP_NM = 5.0


def petal(ultraviolet: float) -> Spectrum:
    """Yellow that reflects this share of the ultraviolet: smooth, and the same for all shares from 400 nm on."""
    nm = np.arange(LIMITS_NM[0], LIMITS_NM[1] + STEP_NM / 2, STEP_NM)
    yellow = DARK + (BRIGHT - DARK) / (1 + np.exp((EDGE_NM - nm) / WIDTH_NM))
    way = np.clip((nm - FULL_NM) / (NONE_NM - FULL_NM), 0, 1)
    share = (1 + np.cos(np.pi * way)) / 2
    return Spectrum(tuple(nm), tuple(np.where(way < 1, share * ultraviolet + (1 - share) * yellow, yellow)))


def add_layout(spec: mujoco.MjSpec, rng: np.random.Generator) -> Layout:
    """Add field and objects, all with upright stripes."""
    spectra = {kind: petal(share) for kind, share in ULTRAVIOLET.items()}
    materials.add_texture(spec, "upright_stripes", materials.stripes((8, 512), 2 * STRIPES, axis=1))
    for kind, spectrum in spectra.items():
        materials.add_textured(spec, kind, "upright_stripes", color=materials.display_color(spectrum))
    return replace(furnished_field(spec), spectra=spectra)
