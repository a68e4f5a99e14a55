"""PSF of an ideal f/4 lens as small as an insect's eye, compared with the Airy pattern.

python examples/01_airy_disk.py [--out airy_disk.png]
"""

import argparse

import numpy as np

from rhabdom import optics

WAVELENGTH, FOCAL_LENGTH, RADIUS = 550e-9, 240e-6, 30e-6

pupil = optics.Pupil(RADIUS, thin_lens_focal_length=FOCAL_LENGTH)
result = optics.psf(pupil, [WAVELENGTH], FOCAL_LENGTH, dx=0.1e-6, shape=(161, 161))

first_zero = 0.6098 * WAVELENGTH * FOCAL_LENGTH / RADIUS
cut, middle = result.psf[0, 80], 80
dark = middle + 10 + int(np.argmin(cut[middle + 10 : middle + 40]))

print(result.plan)
print(f"Strehl ratio        {optics.strehl_ratio(result)[0]:.4f}")
print(f"first dark ring     {result.x[dark] * 1e6:.2f} µm (Airy: {first_zero * 1e6:.2f} µm)")
print(f"energy inside it    {optics.encircled_energy(result, [first_zero])[0, 0]:.4f} (Airy: 0.8378)")

parser = argparse.ArgumentParser()
parser.add_argument("--out", help="save a figure of the PSF to this file")
out = parser.parse_args().out
if out:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (image, line) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
    edge = 8.0
    shown = np.log10(np.maximum(result.psf[0] / result.psf.max(), 1e-8))  # dark rings reach 0
    drawn = image.imshow(shown, vmin=-5, vmax=0, extent=(-edge, edge, -edge, edge), origin="lower", cmap="magma")
    image.set(xlabel="x [µm]", ylabel="y [µm]", title="PSF of an ideal f/4 lens")
    figure.colorbar(drawn, ax=image, label="log$_{10}$ of the PSF over its peak")
    line.semilogy(result.x * 1e6, cut / cut.max())
    line.axvline(first_zero * 1e6, color="0.6", lw=1)
    line.annotate("Airy's first zero", (first_zero * 1e6, 0.3), xytext=(4, 0), textcoords="offset points", fontsize=8)
    line.set(xlabel="x [µm]", ylabel="PSF over its peak", ylim=(1e-6, 2))
    figure.savefig(out, dpi=120)
    print(f"drawn to            {out}")
