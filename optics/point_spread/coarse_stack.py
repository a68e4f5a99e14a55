"""PSFs of several depths and wavelengths from the same samples of the pupil, at coarse tolerances.

The PSFs that need the most samples are those at the shortest wavelength, for the nearest and the farthest source. The
samples that suffice for both are used for all PSFs. The error of each PSF is then checked separately.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from optics.elements.beam import Beam
from optics.elements.torch_numbers import torch_numbers
from optics.methods.pixel_nodes import WindowSamples
from optics.methods.problem import Problem
from optics.methods.window_plan import TIGHTEST
from optics.methods.window_sampling import WindowSampling
from optics.methods.window_stack import WindowStack
from optics.numerics.accuracy import AccuracyError
from optics.numerics.array_library import library, on_host, on_processor
from optics.numerics.autodiff import Array, carries_derivative
from optics.point_spread.request import Setup

__all__ = ["coarse_stack"]


def coarse_stack(
    stack: WindowStack, without: WindowStack, tolerance: float, method: str
) -> tuple[Array, np.ndarray] | None:
    """Return PSFs (source, wavelength, y, x), and a mask of those that meet the tolerance, (source, wavelength).

    The result is None if another method is faster or requested by `method`, if no method meets the tolerance, if the
    tolerance is below 3e-4, or if the pupil's radius carries a derivative.

    stack: the light, whose numbers may carry derivatives of PyTorch. If these numbers are on a GPU, the GPU computes
        the PSFs and their errors.
    without: the same light, with numbers of NumPy that carry no derivatives. The processor plans the samples of the
        pupil from it. If `stack` is on a GPU, only two more kinds of data are copied to the processor. These are the
        errors of the PSFs, and the positions in the window at which each PSF is compared with a sum over finer samples
        of the pupil to find its error.
    tolerance, method: see `optics.psf`.
    """
    # Dr.Jit computes the edge of the aperture, so PyTorch cannot compute derivatives with respect to the radius.
    if tolerance < TIGHTEST or carries_derivative(stack.pupil.aperture_radius):
        return None
    sampling = _sampling(stack, without, tolerance, method)
    if sampling is None:
        return None
    images = stack.intensity(sampling)
    if on_host(images):
        errors = without.errors(sampling, on_processor(images), tolerance)
    else:
        with library(images).no_grad():
            errors = on_processor(stack.errors(sampling, images, tolerance))
    return images, errors <= tolerance  # a dark window has the error NaN, so other methods compute it


def _sampling(stack: WindowStack, without: WindowStack, tolerance: float, method: str) -> WindowSampling | None:
    """Return samples that are sufficient for all sources and wavelengths of `stack`.

    They are planned at the shortest wavelength, for the nearest and for the farthest source. The result is None if, for
    one of these two sources, no method meets the tolerance, or the method that `optics.psf` would choose does not use
    samples of this kind (`WindowSampling`).

    without: copy of `stack` for NumPy, without derivatives.
    """
    wavelength, found = min(without.wavelengths), list[WindowSampling]()
    distances = [source.distance for source in without.sources]
    for place in {int(np.argmin(distances)), int(np.argmax(distances))}:
        setup = Setup(without.distance, without.sources[place], without.window, tolerance, method, without.dtype)
        request = setup.request(without.pupil, wavelength)
        if torch_numbers((stack.pupil, stack.sources, stack.distance)):
            beam = Beam(stack.pupil, stack.sources[place], wavelength, stack.distance)
            problem = Problem.from_beam(beam, without.window, tolerance, without.dtype, fixed=request.beam)
            request = replace(request, problem=problem)
        try:
            sampling = request.planned()[1]
        except AccuracyError:
            return None
        if not isinstance(sampling, WindowSampling):
            return None
        found.append(sampling)
    pupil = max((each.pupil for each in found), key=_across)
    finer = max((each.finer for each in found), key=_across)
    return replace(
        found[0],
        pupil=pupil,
        finer=finer,
        rank=max(each.rank for each in found),
        crossed=any(each.crossed for each in found),
    )


def _across(samples: WindowSamples) -> int:
    return len(samples.at)
