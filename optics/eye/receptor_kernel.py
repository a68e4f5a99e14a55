"""Choice of the module that computes a receptor's kernel.

The kernel comes from `guided_field` if receptors are waveguides, and otherwise from `visual_kernel`. An eye without a
pupil is a perfect lens, whose kernel is a single cell with the value 1 in every band.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from optics.eye.band_choice import choose_bands
from optics.eye.eye_spec import EyeSpec
from optics.eye.guided_field import Guide, guided_kernel
from optics.eye.retina import Retina
from optics.eye.visual_kernel import visual_kernel
from optics.numerics.arguments import without_derivative
from optics.numerics.autodiff import Array, Scalar, number, plain
from optics.numerics.precision import precision
from optics.spectra.bands import SpectralBands
from optics.spectra.spectrum import daylight

__all__ = ["bands_for", "receptor_kernel", "white_share"]

CELLS_FOR_BANDS = 2  # cells per receptor along an axis, for the choice of bands


def receptor_kernel(eye: EyeSpec, retina: Retina, z: Scalar, direction: tuple[float, float], from_cell: bool) -> Array:
    """Return the kernel of an eye, a Dr.Jit tensor (band, ky, kx); see `Eye.kernel`.

    direction: tangents (right, down) of the source's direction.
    from_cell: True if the source is an area of the scene whose geometric image is as large as a cell of the retina,
        False if the source is the point at the centre of this area.
    """
    if eye.pupil is None:
        return precision(retina.dtype).Tensor(np.ones((len(retina.wavelengths), 1, 1)))
    if eye.waveguide is None:
        return visual_kernel(eye.pupil, retina, z, direction, from_cell)
    without_derivative("fov_deg", eye.sensor_distance)
    without_derivative("z", z)
    guide = Guide(eye.waveguide, number(eye.sensor_distance), round(eye.receptor_pitch / retina.cell[1]), from_cell)
    return guided_kernel(eye.pupil, retina, z, direction, guide)


def white_share(kernels: np.ndarray, bands: SpectralBands) -> float:
    """Return the signal of a white surface in daylight, relative to the signal if all light reached the receptors.

    This fraction is averaged over channels.

    kernels: the eye's kernels, array (band, ky, kx). Their sums are below 1 if light is lost.
    """
    seen = kernels.sum(axis=(1, 2)) * daylight(bands.wavelengths)
    return float((bands.weights @ seen).mean())


def bands_for(eye: EyeSpec, retina: Retina, direction: tuple[float, float]) -> SpectralBands:
    """Return the fewest spectral bands whose error is within the eye's tolerance, see `choose_bands`.

    retina: the eye's retina, with two cells along each side of a receptor. Kernels, which describe the blur, have one
        value per cell. `retina.wavelengths` is not used and may be empty, because several numbers of bands are tried,
        and kernels are computed at the wavelengths of these bands.
    direction: tangents (right, down) of the direction in which the kernels are computed.
    """
    if eye.pupil is None:
        return choose_bands(eye.tolerance, eye.receptors)
    guided = eye.waveguide is not None

    def kernels(wavelengths: np.ndarray) -> np.ndarray:
        on = replace(retina, wavelengths=wavelengths)
        return plain(receptor_kernel(eye, on, math.inf, direction, guided))

    if guided:
        return choose_bands(eye.tolerance, eye.receptors, kernels)
    return choose_bands(eye.tolerance, eye.receptors, kernels, CELLS_FOR_BANDS, number(eye.pupil.transmission))
