"""Figures of one eye's optics: relief of the pupil, point spread function and modulation transfer function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.patches import Circle, Rectangle

import optics
from evolve.analysis.white_light import WhiteLight
from evolve.config.run_config import EyeConfig
from evolve.genome.phenotype import Phenotype
from evolve.report.facet_figures import facet_figures
from evolve.report.hints import hint
from evolve.report.markup import Html, figure, html, joined, key, rounded
from evolve.report.svg import drawing, inline
from evolve.report.theme import ACCENT, INK, LINES, MUTED, VERMILLION
from optics.numerics.precision import precision
from optics.spectra.bands import daylight

__all__ = ["DECADES", "eye_figures", "middle_of_psf", "relief_heights"]

SIZE = (370, 310)
PIXELS = 161  # maximum number of pixels along a side of an image; more would be invisible on the page
DECADES = 4  # range of the PSF's logarithmic colour scale [powers of ten]
SHOWN_POWER = 0.98  # fraction of the PSF's light that lies within the image


def eye_figures(phenotype: Phenotype, config: EyeConfig, medium: str = "air") -> Html:
    """Return the figures of an animal's eye with their captions. For a perfect lens, return a sentence instead.

    For compound eyes, see `facet_figures`. If the PSF cannot be computed accurately enough, a line of text with the
    reason replaces a figure.

    medium: medium of the run's worlds: "air", "clear_ocean", "coastal_water" or "fog"
    """
    eye = phenotype.eye(config, medium)
    if not isinstance(eye, optics.Eye):
        return facet_figures(eye, phenotype)
    if eye.pupil is None:
        return html("<p>Optics are off in this run: every eye has a perfect lens, which neither blurs nor dims.</p>\n")
    pupil = _pupil(eye, phenotype)
    try:
        light = WhiteLight.from_eye(eye)
    except optics.AccuracyError as error:
        parts = [pupil, _unknown("Point spread function", error)]
    else:
        measured = (("Point spread function", _psf), ("Cuts", _cuts), ("Contrast", _mtf))
        parts = [pupil, *(_or_why_not(name, draw, light) for name, draw in measured)]
    return html('<div class="figures pairs">{}</div>\n', joined(parts))


def _or_why_not(name: str, draw: Callable[[WhiteLight], Html], light: WhiteLight) -> Html:
    """Return a figure, or a line of text if the PSF cannot be computed accurately enough."""
    try:
        return draw(light)
    except optics.AccuracyError as error:
        return _unknown(name, error)


def _unknown(name: str, error: optics.AccuracyError) -> Html:
    return html("<p><b>{}.</b> It cannot be computed: {}.</p>", name, str(error))


def _pupil(eye: optics.Eye, phenotype: Phenotype) -> Html:
    """Return the figure of the relief's height over the pupil."""
    pupil = eye.pupil
    assert pupil is not None
    heights, inside = relief_heights(pupil)
    low, high = 1e6 * heights[inside].min(), 1e6 * heights[inside].max()
    radius = 1e6 * pupil.aperture_radius
    with drawing(*SIZE) as drawn:
        axes = drawn.subplots()
        extent = (-radius, radius, -radius, radius)
        # The rim of a circular aperture is drawn exactly; other apertures are masked pixel by pixel.
        seen = 1e6 * (heights if _is_round(pupil) else np.where(inside, heights, np.nan))
        picture = axes.imshow(seen, extent=extent, origin="lower", interpolation="none", vmin=low, vmax=high)
        picture.set_clip_path(Circle((0, 0), radius, transform=axes.transData))
        _bar(axes, picture, "height [µm]")
        axes.grid(False)
        axes.set_xlabel("x [µm]")
        axes.set_ylabel("y [µm]")
        svg = inline(drawn, "pupil", f"Height map of the pupil's relief, from {low:.3g} to {high:.3g} µm.")
    index = phenotype.refractive_index or 1.0
    waves = (index - 1) * (high - low) / 0.55
    caption = html(
        "<b>Pupil.</b> Height of its {}, from {} to {} µm within a radius of {} µm (a = {}). With n = {} the relief "
        "delays green light (550 nm) by up to {} waves across the pupil.",
        *(hint("relief"), rounded(low), rounded(high), rounded(radius), rounded(eye.relative_aperture)),
        *(rounded(index, 4), rounded(waves)),
    )
    return figure(svg, caption)


def _is_round(pupil: optics.Pupil | None) -> bool:
    return pupil is not None and isinstance(pupil.aperture, optics.Circle)


def relief_heights(pupil: optics.Pupil) -> tuple[np.ndarray, np.ndarray]:
    """Return the heights of the relief [m] and the mask of the aperture, both (y, x).

    They cover the square around the pupil; row 0 is at the lowest y. Without a relief, all heights are 0.
    """
    types = precision("float64")
    centres = (np.arange(PIXELS) + 0.5) / PIXELS * 2 - 1
    x, y = (plane.ravel() for plane in np.meshgrid(centres, centres))
    if pupil.height is None:
        heights = np.zeros(x.size)
    else:
        heights = pupil.height.height(types.Float64(x), types.Float64(y)).numpy()
    shape = (PIXELS, PIXELS)
    return heights.reshape(shape), np.reshape(pupil.aperture.contains(x, y), shape)


def _psf(light: WhiteLight) -> Html:
    """Return the figure of the PSF in white daylight on a logarithmic scale, with the outline of a receptor."""
    picture, half = middle_of_psf(light)
    edge, pitch = 1e6 * half, 1e6 * light.eye.receptor_pitch
    peak = picture.max()
    with drawing(*SIZE) as drawn:
        axes = drawn.subplots()
        image = axes.imshow(
            np.maximum(picture, peak * 10.0**-DECADES) / 1e12,
            extent=(-edge, edge, -edge, edge),
            origin="lower",
            norm=LogNorm(peak * 10.0**-DECADES / 1e12, peak / 1e12),
            interpolation="none",
        )
        axes.add_patch(Rectangle((-pitch / 2, -pitch / 2), pitch, pitch, fill=False, ec="#ffffff", lw=1.2))
        axes.set(xlim=(-edge, edge), ylim=(-edge, edge), xlabel="x on the retina [µm]", ylabel="y [µm]")
        axes.grid(False)
        _bar(axes, image, "PSF [1/µm²]")
        _degrees(axes, light.eye, edge)
        svg = inline(drawn, "psf", f"Point spread function over {2 * edge:.3g} µm, peak {peak / 1e12:.3g} per µm².")
    plan = light.psf.plan
    caption = html(
        "<b>{}</b> of a distant point: sum over all {}, weighted by white daylight, on a logarithmic scale of {} "
        "decades. The white square is one {}, {} µm wide. The least accurate band was computed by the method {}, with "
        "a predicted error of {}.",
        *(hint("psf", "Point spread function"), hint("bands"), DECADES, hint("receptor"), rounded(pitch)),
        *(plan.method.replace("_", " "), f"{plan.predicted_error:.2g}"),
    )
    return figure(svg, caption)


def middle_of_psf(light: WhiteLight) -> tuple[np.ndarray, float]:
    """Return the central part of the PSF in white daylight [1/m²], (y, x), and half the width of this part [m].

    This part contains at least 98 % of the light, up to rounding. It is at least 3 receptors wide, unless the computed
    PSF is narrower. The PSF is averaged over blocks, so that the part has at most 161 pixels along a side.
    """
    image, dx = light.white.psf[0], light.white.dx
    middle = image.shape[0] // 2
    ring = np.maximum(*np.abs(np.indices(image.shape) - middle))
    power = np.cumsum(np.bincount(ring.ravel(), image.ravel()))
    reach = int(np.searchsorted(power, SHOWN_POWER * power[-1]))
    reach = max(reach, int(1.5 * light.eye.receptor_pitch / dx), 8)
    reach = min(reach, middle)
    block = -(-(2 * reach + 1) // PIXELS)
    cells = (2 * reach + 1) // block
    first = middle - cells * block // 2
    cut = image[first : first + cells * block, first : first + cells * block]
    return cut.reshape(cells, block, cells, block).mean(axis=(1, 3)), cells * block * dx / 2


def _cuts(light: WhiteLight) -> Html:
    """Return the figure of the PSF along the line y = 0 through the optical axis.

    It shows all bands, or six evenly spaced ones if there are more.
    """
    psf = light.psf
    _, half = middle_of_psf(light)
    inside = np.abs(psf.x) <= half
    row = psf.psf.shape[1] // 2
    cuts = psf.psf[:, row][:, inside] / 1e12
    with drawing(*SIZE) as drawn:
        axes = drawn.subplots()
        chosen = np.unique(np.linspace(0, len(cuts) - 1, min(len(cuts), 6)).astype(int))
        for band, colour in zip(chosen, LINES, strict=False):
            label = f"{1e9 * psf.wavelengths[band]:.0f} nm"
            axes.semilogy(1e6 * psf.x[inside], cuts[band], color=colour, lw=1.2, label=label)
        axes.set(xlim=(-1e6 * half, 1e6 * half), ylim=(cuts.max() * 10.0**-DECADES, 2 * cuts.max()))
        axes.set(xlabel="x on the retina [µm]", ylabel="PSF [1/µm²]")
        axes.legend(frameon=False, loc="best", handlelength=1.2, labelcolor=MUTED)
        _degrees(axes, light.eye, 1e6 * half)
        svg = inline(drawn, "psf-bands", "Cuts through the point spread function in up to six spectral bands.")
    caption = html("<b>PSF in up to six bands</b>: cuts along x through the optical axis.")
    return figure(svg, caption)


def _mtf(light: WhiteLight) -> Html:
    """Return the figure of the MTF (contrast over spatial frequency), with a diffraction limit.

    The limit is that of a circular pupil as wide as the eye's.
    """
    eye, scale = light.eye, light.per_degree
    cutoff = light.psf.cutoff
    nyquist = light.nyquist
    frequency = np.geomspace(min(nyquist / 8, cutoff.max() / 100), cutoff.max(), 240)
    contrast = light.mtf.profile(frequency)[0]
    with drawing(*SIZE) as drawn:
        axes = drawn.subplots()
        axes.semilogx(frequency * scale, diffraction_limit(light, frequency), color=INK, lw=1.2, ls="--")
        axes.semilogx(frequency * scale, contrast, color=ACCENT, lw=2)
        axes.axvline(nyquist * scale, color=VERMILLION, lw=1.2, ls=":")
        axes.set(xlim=(frequency[0] * scale, frequency[-1] * scale), ylim=(-0.02, 1.04))
        axes.set(xlabel="spatial frequency [cycles / degree]", ylabel="contrast (MTF)")
        at_nyquist = float(np.interp(nyquist, frequency, contrast))
        svg = inline(
            drawn, "mtf", f"Modulation transfer function; {at_nyquist:.2g} at the receptors' Nyquist frequency."
        )
    green = int(np.argmin(np.abs(light.psf.wavelengths - 550e-9)))
    strehl = optics.strehl_ratio(light.psf.of_wavelength(green))[0]
    of_whom = "" if _is_round(eye.pupil) else " of a circle of this width"
    caption = html(
        "<b>{}</b> in white daylight, averaged over all orientations ({}), and the diffraction limit{} (dashed). The "
        "dotted line is the receptors' Nyquist frequency, {} cycles per degree, where the contrast is {}. The {} is {} "
        "at {} nm. The image quality is {} (from 0 to 1: contrast above the noise, times throughput).",
        *(hint("mtf", "Modulation transfer function"), key("accent"), of_whom, rounded(nyquist * scale)),
        *(
            rounded(at_nyquist),
            hint("Strehl ratio"),
            rounded(strehl),
            f"{1e9 * light.psf.wavelengths[green]:.0f}",
            rounded(light.image_quality),
        ),
    )
    return figure(svg, caption)


def diffraction_limit(light: WhiteLight, frequency: np.ndarray) -> np.ndarray:
    """Return the MTF of a circular pupil without aberrations in white daylight.

    The pupil is as wide as that of `light.eye`. The result is an array (frequency,).

    In each band, the MTF is (2/π)(arccos s - s √(1 - s²)) for s < 1, else 0, where s is the frequency divided by the
    cutoff frequency (Goodman, Fourier Optics, §6.3.3). The bands are weighted by daylight and by the mean sensitivity
    of this eye's channels.

    frequency: spatial frequencies on the retina [1/m], (frequency,)
    """
    weights = light.eye.spectral_bands.weights.mean(axis=0) * daylight(light.psf.wavelengths)
    s = np.clip(frequency / light.psf.cutoff[:, None], 0, 1)
    limits = 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2))
    return weights / weights.sum() @ limits


def _bar(axes: Axes, picture: Any, label: str) -> None:
    bar = axes.figure.colorbar(picture, ax=axes, shrink=0.92, pad=0.02, aspect=24)
    assert bar.solids is not None
    bar.solids.set_rasterized(True)
    bar.outline.set_visible(False)
    bar.set_label(label, color=MUTED)


def _degrees(axes: Axes, eye: optics.Eye, edge: float) -> None:
    """Add an axis at the top, which shows the visual angle [°] of positions on the retina [µm]."""
    distance = 1e6 * eye.sensor_distance
    top = axes.secondary_xaxis(
        "top",
        functions=(
            lambda x: np.degrees(np.arctan2(x, distance)),
            lambda angle: distance * np.tan(np.radians(angle)),
        ),
    )
    top.set_xlabel("visual angle [°]", color=MUTED)
    top.tick_params(length=3)
