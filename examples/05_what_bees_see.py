"""Signals of a camera, a human, a goldfish and a bee for two flowers that a camera cannot distinguish.

python examples/05_what_bees_see.py [--out eyes.png]   (--out: the task `foraging` through the eyes of each)
"""

import argparse

import numpy as np

from rhabdom import optics, sim
from rhabdom.sim.worlds.foraging import ULTRAVIOLET, petal

SHOWN = {"rgb": "camera", "lms": "human", "goldfish": "goldfish", "honeybee": "bee"}

for name in SHOWN:
    eye = optics.Eye(resolution=(1, 1), bands=16, receptors=name)
    wavelengths = eye.spectral_bands.wavelengths
    daylight = optics.illuminant("D65").at(wavelengths)
    goal, adversary = (
        eye.see((petal(share).at(wavelengths) * daylight)[:, None, None], 1)[:, 0, 0] for share in ULTRAVIOLET.values()
    )
    peaks = ", ".join(f"{kind.peak_nm:.0f}" for kind in eye.receptors.types)
    contrast = np.abs(goal - adversary).max() / eye.noise_sigma
    print(f"{name:<9} receptors of {peaks:<19} nm differ by {contrast:5.1f} standard deviations of their noise")

parser = argparse.ArgumentParser()
parser.add_argument("--out", help="save a figure of the eyes' signals to this file")
out = parser.parse_args().out
if out:
    from matplotlib import pyplot

    figure, rows = pyplot.subplots(len(SHOWN), figsize=(4.4, 8.4), layout="constrained")
    for row, (name, who) in zip(rows, SHOWN.items(), strict=True):
        eyes = sim.Eyes(n_eyes=1, resolution=(30, 60), fov_deg=45, receptors=name, bands=8)
        world = sim.make_env("foraging", eyes, render_mode="eyes")
        world.reset(seed=2429)  # goal and adversary are in front
        row.imshow(world.render(), interpolation="nearest")
        row.set(xticks=[], yticks=[])
        row.set_ylabel(who, fontsize=13)
        row.spines[:].set_visible(False)
    figure.savefig(out, dpi=110)
    print(f"drawn to  {out}")
