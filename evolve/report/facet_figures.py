"""Figures of a compound eye's ommatidia: acceptance function, and cuts through it in up to six bands."""

from __future__ import annotations

import numpy as np

import sim
from evolve.genome.phenotype import Phenotype
from evolve.report.markup import Html, figure, html, joined, rounded
from evolve.report.svg import drawing, inline
from evolve.report.theme import LINES, MUTED
from optics.eye.acuity import eye_parameter
from optics.spectra.spectrum import daylight

__all__ = ["facet_figures", "white_acceptance"]

SIZE = (370, 310)
SHOWN = 1e-3  # the image extends to this fraction of the maximum


def white_acceptance(eye: sim.CompoundEye) -> tuple[np.ndarray, np.ndarray]:
    """Return angles off the axis, and the acceptance function of the first ommatidium in white daylight.

    The angles [degrees] have the shape (n,). The acceptance is given on the grid of these angles in both directions,
    (up, right), as fractions of its maximum. It has the shape (n, n). Bands are weighted by daylight and by
    the mean sensitivity of the eye's channels.
    """
    bands, accepted = eye.spectral_bands, eye.acceptance(0)
    weights = bands.weights.mean(axis=0) * daylight(bands.wavelengths)
    white = np.tensordot(weights, accepted.values, axes=1)[:, ::-1]  # x of the table points to the owner's left
    across = np.flatnonzero((white >= SHOWN * white.max()).any(axis=0))
    half = max(int(np.abs(across - len(white) // 2).max()), 4)
    part = slice(len(white) // 2 - half, len(white) // 2 + half + 1)
    return np.degrees(np.arcsin(accepted.sines[part])), white[part, part] / white.max()


def facet_figures(eye: sim.CompoundEye, phenotype: Phenotype) -> Html:
    """Return the figures of the ommatidia with their captions."""
    return html('<div class="figures pairs">{}</div>\n', joined([_acceptance(eye, phenotype), _cuts(eye)]))


def _acceptance(eye: sim.CompoundEye, phenotype: Phenotype) -> Html:
    angles, white = white_acceptance(eye)
    spacing = phenotype.fov_deg / phenotype.resolution[1]
    with drawing(*SIZE) as drawn:
        axes = drawn.subplots()
        edge = float(angles[-1])
        image = axes.imshow(white, extent=(-edge, edge, -edge, edge), origin="lower", interpolation="none", vmin=0)
        axes.set(xlabel="right [°]", ylabel="up [°]")
        axes.grid(False)
        bar = drawn.colorbar(image, ax=axes, shrink=0.92, pad=0.02, aspect=24)
        bar.outline.set_visible(False)
        bar.set_label("acceptance / maximum", color=MUTED)
        svg = inline(drawn, "acceptance", f"Acceptance function of an ommatidium over {2 * edge:.3g} degrees.")
    diameter = phenotype.facet_diameter_um or 0.0
    caption = html(
        "<b>Acceptance function</b> of an ommatidium in white daylight: the fraction of a distant point's light on the "
        "facet that the rhabdom absorbs, by wave optics. The facets are {} µm wide (F/{}), the rhabdoms {} µm wide and "
        "{} µm long. Neighbours in a row are {}° apart on average, so the eye parameter DΔφ is {} µm.",
        *(rounded(diameter), rounded(phenotype.f_number or 0.0), rounded(phenotype.rhabdom_diameter_um or 0.0)),
        *(rounded(phenotype.rhabdom_length_um or 0.0), rounded(spacing), rounded(eye_parameter(diameter, spacing))),
    )
    return figure(svg, caption)


def _cuts(eye: sim.CompoundEye) -> Html:
    """Return the figure of the acceptance function along a horizontal line through the axis.

    It shows all bands, or six evenly spaced ones if there are more.
    """
    angles, _ = white_acceptance(eye)
    accepted = eye.acceptance(0)
    middle = len(accepted.sines) // 2
    part = slice(middle - len(angles) // 2, middle + len(angles) // 2 + 1)
    with drawing(*SIZE) as drawn:
        axes = drawn.subplots()
        chosen = np.unique(np.linspace(0, len(accepted.values) - 1, len(LINES)).astype(int))
        for band, colour in zip(chosen, LINES, strict=False):
            label = f"{1e9 * eye.spectral_bands.wavelengths[band]:.0f} nm"
            axes.plot(angles, accepted.values[band, middle, ::-1][part], color=colour, lw=1.2, label=label)
        axes.set(xlabel="right [°]", ylabel="fraction of the light", ylim=(0, None))
        axes.legend(frameon=False, handlelength=1.2, labelcolor=MUTED)
        svg = inline(drawn, "acceptance-bands", "Cuts through the acceptance function in up to six spectral bands.")
    return figure(svg, html("<b>Acceptance in up to six bands</b>: cuts along a horizontal line through the axis."))
