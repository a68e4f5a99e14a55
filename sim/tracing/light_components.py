"""Components into which the closed-form tracer divides light, often fewer than the spectral bands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

RANK_TOLERANCE = 1e-6  # smaller singular values, relative to the largest, are rounding errors of float32 (1.2e-7)
# Chosen: largest deviation of a grey reflectance from its mean over the bands. Mitsuba's greys are not quite flat.
GREY = 1e-4


@dataclass(frozen=True)
class Components:
    """Components of light, which are traced like spectral bands, and the contribution of each component to each band.

    The radiance in band b is sum_k basis[k, b] reflectance_k sum_l levels[l, k] cos θ_l. The index k counts components,
    and l counts lights with the angle of incidence θ_l.

    reflectance: (texel, component)
    levels: levels of the lights, (light, component)
    basis: (component, band)
    """

    reflectance: np.ndarray
    levels: np.ndarray
    basis: np.ndarray


def components_of(texels: np.ndarray, irradiance: np.ndarray) -> Components:
    """Return components for light that is reflected only once.

    Components are fixed spectra. The light that any surface reflects is a weighted sum of them. There are fewer
    components than bands if all lights share one spectrum and the reflectances are linear combinations of fewer spectra
    than there are bands. Otherwise, each component is one band.

    texels: reflectances of the surfaces, (texel, band)
    irradiance: irradiance of each light, (light, band)
    """
    n_bands = texels.shape[1]
    brightest = irradiance[np.argmax(irradiance.sum(axis=1))]
    level = irradiance @ brightest / (brightest @ brightest)
    if np.allclose(irradiance, level[:, None] * brightest, rtol=0, atol=RANK_TOLERANCE * irradiance.max()):
        u, s, vt = np.linalg.svd(texels, full_matrices=False)
        rank = max(int((s > RANK_TOLERANCE * s[0]).sum()), 1)
        if rank < n_bands:
            return Components(u[:, :rank] * s[:rank], np.tile(level[:, None], rank), vt[:rank] * brightest / np.pi)
    return components_in_bands(texels, irradiance)


def reflected_components_of(texels: np.ndarray, irradiance: np.ndarray) -> Components:
    """Return components for light that is reflected several times.

    Components are fixed spectra, and light is a weighted sum of them. The components are chosen so that each reflection
    multiplies the weight of each component by one number, the surface's reflectance for this component. One component
    is enough if all surfaces are grey and all lights share one spectrum. Otherwise, each component is one band.

    texels, irradiance: see `components_of`
    """
    grey = texels.mean(axis=1, keepdims=True)
    if np.abs(texels - grey).max() <= GREY:
        few = components_of(np.tile(grey, texels.shape[1]), irradiance)
        if len(few.basis) == 1:
            scale = few.reflectance[:, 0] @ grey[:, 0] / (grey[:, 0] @ grey[:, 0])
            return Components(few.reflectance / scale, few.levels, few.basis * scale)
    return components_in_bands(texels, irradiance)


def components_in_bands(texels: np.ndarray, irradiance: np.ndarray) -> Components:
    """Return one component of light for each spectral band.

    Light that crosses a medium or is reflected several times generally needs all bands.

    texels, irradiance: see `components_of`
    """
    return Components(texels, irradiance, np.eye(texels.shape[1]) / np.pi)
