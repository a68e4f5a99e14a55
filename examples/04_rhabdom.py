"""A fly's ommatidium: modes of its rhabdom, and the angular sensitivity of each mode.

python examples/04_rhabdom.py [--out rhabdom.png]
"""

import argparse

import numpy as np

from rhabdom import optics

WAVELENGTH = 400e-9
facet = optics.FacetLens(diameter=25e-6, radius_front=22.5e-6, medium_n=1.34)
rhabdom = optics.Waveguide(diameter=2e-6, n_core=1.363, n_clad=1.340, length=200e-6)
eye = optics.Ommatidium(facet, rhabdom)

angles = np.radians(np.linspace(-3, 3, 181))
modes, powers = eye.modes(WAVELENGTH), eye.mode_power(angles, 0 * angles, WAVELENGTH)
sensitivity = eye.sensitivity(angles, 0 * angles, WAVELENGTH)
acceptance = np.degrees(eye.acceptance_angle(WAVELENGTH))
gaussian = np.degrees(optics.snyder_acceptance(25e-6, facet.object_focal_length(), 2e-6, WAVELENGTH))

print(f"V = {rhabdom.v_number(WAVELENGTH):.2f} at {WAVELENGTH * 1e9:.0f} nm")
for mode, power in zip(modes, powers, strict=True):
    if not mode.sine:
        print(f"LP{mode.l}{mode.m}: {mode.core_share:.2f} in the core, accepts at most {power.max():.2f} of the light")
print(f"acceptance angle {acceptance:.2f}°, all Gaussian {gaussian:.2f}°")

parser = argparse.ArgumentParser()
parser.add_argument("--out", help="save a figure of modes and sensitivity to this file")
out = parser.parse_args().out
if out:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    shown = [(mode, power) for mode, power in zip(modes, powers, strict=True) if not mode.sine]
    figure = plt.figure(figsize=(9, 3.8), layout="constrained")
    grid = figure.add_gridspec(2, 4)
    at = np.linspace(-2e-6, 2e-6, 121)
    for place, (mode, _) in enumerate(shown[:4]):
        axes = figure.add_subplot(grid[place // 2, place % 2])
        field = mode.field(at[None, :], at[:, None])
        axes.imshow(field, extent=(-2, 2, -2, 2), origin="lower", cmap="RdBu_r", vmin=-1e6, vmax=1e6)
        axes.add_patch(plt.Circle((0, 0), 1, fill=False, ec="0.3", lw=1))
        axes.set(title=f"LP$_{{{mode.l}{mode.m}}}$", xticks=[-1, 1], yticks=[-1, 1])
        axes.tick_params(labelsize=8)
    axes = figure.add_subplot(grid[:, 2:])
    for mode, power in shown[:4]:
        axes.plot(np.degrees(angles), power, lw=1.2, label=f"LP$_{{{mode.l}{mode.m}}}$")
    axes.plot(np.degrees(angles), sensitivity, "k", lw=2, label="absorbed")
    half = np.degrees(angles) / gaussian
    axes.plot(np.degrees(angles), sensitivity.max() * 0.5 ** (4 * half**2), ":", color="0.4", label="all Gaussian")
    axes.set(xlabel="angle off the axis [°]", ylabel="share of the light on the facet", ylim=(0, None))
    axes.set_title(f"facet 25 µm, rhabdom 2 µm, {WAVELENGTH * 1e9:.0f} nm: Δρ = {acceptance:.2f}°", fontsize=10)
    axes.legend(fontsize=8)
    figure.savefig(out, dpi=120)
    print(f"drawn to {out}")
