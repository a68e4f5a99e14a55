"""Parameters that describe the propagation from a pupil to a window. Methods derive their samples from them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np

from optics.apertures.aperture import EDGE_REACH, Aperture
from optics.apertures.pixelated import PixelatedAperture
from optics.elements.beam import Beam
from optics.elements.derivative_knots import DerivativeKnots, carries_derivatives, derivative_knots
from optics.elements.light_stack import LightStack
from optics.elements.torch_numbers import refuse_torch
from optics.elements.wavefront_slopes import Slopes
from optics.methods.derivative_cells import derivative_cells
from optics.methods.pupil_edge import PupilEdge
from optics.methods.rays import Rays
from optics.methods.scalar_theory import ROUND, light_spread, scalar_theory_error, steepest_sine
from optics.numerics.arguments import in_range, positive
from optics.numerics.autodiff import carries_derivative
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.numerics.quadrature import stepped_up

__all__ = ["SLOPE_MARGIN", "Problem"]

# Choice: factor on the steepest slope of a wavefront, because the grid of slopes may miss the steepest point.
SLOPE_MARGIN = 1.02
# Choice: amplitude ripple of the soft aperture and of the spectral taper, relative to the tolerance on intensity.
# Edge-diffracted light then has a relative amplitude error of several ripples. Its relative intensity error is twice as
# large, which is half the tolerance in a window without other light.
EDGE_RIPPLE_PER_TOLERANCE = 0.1
BRIGHT_EDGE_RIPPLE_PER_TOLERANCE = 0.3  # choice: the same ripple if only light within `reach` must be accurate
FADE_RIPPLE_PER_TOLERANCE = 3.0  # choice: the same for a steep pupil's light beyond the band, which fades out
DETAIL_PART = 0.1  # choice: phase [rad] of neglected detail, relative to the tolerance
# Choice: divisor of DETAIL_PART if derivatives with respect to single numbers are requested. Neglected detail can
# dominate such a derivative, for example with respect to the focal length of a lens in focus.
FINER_DETAIL = 10.0


@dataclass(frozen=True)
class Problem:
    """One monochromatic propagation from a pupil to a window, described by numbers.

    light: the beam. Its source and its distance to the window are plain numbers, without derivatives.
    aperture, wavelength: shape of the pupil, and wavelength [m] in the medium behind it.
    radius, distance: radius of the pupil and distance of the window's plane [m].
    window, tolerance: grid of the output, and allowed relative L2 error of the intensity over this grid.
    symmetric, even: True if the light behind the pupil is rotationally symmetric, or even in x and in y.
    widest_band: frequency [1/m] beyond which methods may omit light; infinite if they must not omit any.
    reach: distance [m] from the axis within which all light lies, except for a fraction of the tolerance. Samples
        beyond may be wrong, and diffraction by the edge may be less accurate. None: the whole window must be accurate.
    medium_n: refractive index behind the pupil.
    masked: True if a mask scatters light where no rays arrive. Approximate methods then cannot predict their error.
    spread: mean square distance of the light from the axis along one direction, in squared radii (`light_spread`).
    differentiated: True if the PSF carries derivatives.
    moves, resized: True if derivatives with respect to the distance or the radius, respectively, are requested.
    knots: rectangles (cells) between samples of a relief, wavefront or mask that carry derivatives; None: none do.
    detail_part: phase [rad] below which fine detail of the pupil is neglected, divided by the tolerance.
    all_light: True if the samples must resolve all light behind the pupil, even if the window needs fewer samples.
    steep: True if most light of a steep relief misses the window. `smooth_spectrum` then removes light beyond `reach`.
    """

    light: Beam
    aperture: Aperture
    radius: float
    wavelength: float
    distance: float
    window: Grid
    symmetric: bool
    tolerance: float
    dtype: str = "float32"
    widest_band: float = math.inf
    reach: float | None = None
    masked: bool = False
    medium_n: float = 1.0
    spread: float = ROUND
    even: bool = False
    differentiated: bool = False
    moves: bool = False
    resized: bool = False
    knots: DerivativeKnots | None = None
    detail_part: float = DETAIL_PART
    all_light: bool = False
    steep: bool = False

    @classmethod
    def from_beam(
        cls,
        beam: Beam,
        window: Grid,
        tolerance: float,
        dtype: str = "float32",
        derivatives: bool = True,
        fixed: Beam | None = None,
    ) -> Problem:
        """Return the problem for a beam that passes a pupil and arrives at a window.

        derivatives: whether the samples must also be suitable for the derivatives that the beam carries.
        fixed: the same light without derivatives. It is necessary if the beam carries tensors of PyTorch.

        Raises:
            ValueError: the distance is not positive, the tolerance is not in [1e-12, 0.5], the dtype is invalid, or
                `fixed` is None although a tensor of PyTorch requires a gradient.
        """
        distance = positive("sensor_distance", beam.distance, carried=True)
        tolerance = in_range("tolerance", tolerance, 1e-12, 0.5)
        precision(dtype)
        plain = fixed or Beam(beam.pupil, beam.source.plain, beam.wavelength, distance)
        if fixed is None:
            if not (derivatives and carries_derivatives(beam)):
                return _problem(plain, window, tolerance, dtype)
            refuse_torch(beam)
        found = _differentiated(plain, window, tolerance, dtype, derivative_knots(beam.pupil, beam.wavelength))
        # A small change of the angle breaks the symmetry of light along the axis.
        still = not any(map(carries_derivative, beam.source.angle))
        symmetric = found.symmetric and still and beam.pupil.rotationally_symmetric(beam.wavelength)
        even = found.even and still and beam.pupil.mirror_symmetric(beam.wavelength)
        moves, resized = map(carries_derivative, (beam.distance, beam.radius))
        return replace(found, aperture=beam.aperture, moves=moves, resized=resized, symmetric=symmetric, even=even)

    @cached_property
    def stack(self) -> LightStack:
        """Stack that contains only the beam `light`, for code that handles several beams at once."""
        return LightStack((self.light,))

    @cached_property
    def slopes(self) -> Slopes:
        """Gradient of the optical path across the pupil, on a grid that resolves the pupil's relief and wavefront."""
        return self.light.pupil.slopes(self.light.wavelength, self.light.source)

    @cached_property
    def detail(self) -> float:
        """Frequency [1/m] of fine detail in relief, wavefront and mask, which is added to the frequency due to slopes.

        Above it, components of phase and mask are below `detail_part` · tolerance. Square-pixel reliefs are ignored.
        """
        return self.light.pupil.bandwidth(self.light.wavelength, self.detail_part * self.tolerance)

    @cached_property
    def other_detail(self) -> float:
        """Value of `detail` for the pupil without those maps (relief, wavefront, mask) that carry derivatives."""
        assert self.knots is not None
        others = self.knots.without_maps(self.light.pupil)
        return others.bandwidth(self.light.wavelength, DETAIL_PART * self.tolerance)

    @property
    def phase_band(self) -> float:
        """Highest spatial frequency [1/m] of the phase over the pupil's disk and the soft edge around the disk."""
        return SLOPE_MARGIN * self.slopes.steepest / self.light.wavelength + self.detail

    @property
    def phase_band_inside(self) -> float:
        """Highest spatial frequency [1/m] of the phase over the pupil's disk, without the soft edge around the disk."""
        return SLOPE_MARGIN * self.slopes.steepest_inside / self.light.wavelength + self.detail

    @cached_property
    def turning(self) -> float:
        """Largest gradient [cycles/m] across the pupil of the phase of paths from source to points of the window."""
        return self._turning[0]

    @cached_property
    def turning_inside(self) -> float:
        """Largest phase gradient [cycles/m] like `turning`, but over the pupil's disk without the soft edge."""
        return self._turning[1]

    @cached_property
    def _turning(self) -> tuple[float, float]:
        soft, inside = self.slopes.turning(self.distance, self.window, self.medium_n)
        margin = SLOPE_MARGIN / (self.wavelength * self.medium_n)
        return margin * soft + self.detail, margin * inside + self.detail

    @cached_property
    def rays(self) -> Rays | None:
        """Rays of geometrical optics, which predict the errors of methods; None if the pupil's pixels scatter light."""
        if self.pixelated is not None:
            return None
        return Rays.from_slopes(self.slopes, self.aperture, self.distance, self.medium_n)

    def cells(self, band: float | None = None) -> PixelatedAperture | None:
        """Return the aperture, divided into cells with quadrature nodes, or None if too many cells would be necessary.

        band: highest frequency [1/m] of the light's spectrum, if this spectrum is computed from the nodes. None: the
            nodes resolve the phase of the light from points of the pupil when it arrives at any point of the window.
        """
        assert self.knots is not None
        slopes = self._turning_slopes if band is None else self._slopes
        cycles = self.radius * (slopes / (self.wavelength * self.medium_n) + self.other_detail + (band or 0.0))
        opening = self.aperture.opening if isinstance(self.aperture, PixelatedAperture) else self.aperture
        return derivative_cells(opening, self.knots, cycles, self.tolerance)

    @cached_property
    def _slopes(self) -> np.ndarray:
        """Slopes of the wavefront over the pupil and up to `_beyond_rim` [radii] beyond it, see `Slopes.spread`."""
        return self.slopes.spread(self._beyond_rim)

    @cached_property
    def _turning_slopes(self) -> np.ndarray:
        """Upper bounds on the slopes of paths from source to any point of the window, over the area of `_slopes`."""
        return self.slopes.spread(self._beyond_rim, (self.window, self.distance, self.medium_n))

    @property
    def _beyond_rim(self) -> float:
        """Upper bound [radii] on distances of quadrature nodes beyond the pupil's rim: the largest cell's diagonal."""
        assert self.knots is not None
        return math.sqrt(2) * max(after - before for before, after in pairwise(self.knots.borders))

    @property
    def divided(self) -> bool:
        """True if the aperture must be divided, into the pixels of a relief or into the rectangles of `cells`."""
        return self.pixelated is not None or self.knots is not None

    @property
    def pixelated(self) -> PixelatedAperture | None:
        """Aperture divided into pixels, if the phase jumps from pixel to pixel; else None."""
        return self.aperture if isinstance(self.aperture, PixelatedAperture) else None

    @property
    def ripple(self) -> float:
        """Amplitude error that the aperture's spectrum may have because the aperture's edge is softened."""
        return self.tolerance * (EDGE_RIPPLE_PER_TOLERANCE if self.reach is None else BRIGHT_EDGE_RIPPLE_PER_TOLERANCE)

    @property
    def fade_ripple(self) -> float:
        """Allowed amplitude error of light at frequencies beyond `band`, where the spectrum fades out."""
        if self.steep:
            return min(FADE_RIPPLE_PER_TOLERANCE * self.tolerance, 0.1)
        return self.ripple if self.reach is None else 0.1  # choice: there is hardly any light beyond the band

    @property
    def outermost(self) -> float:
        return self.window.half_diagonal if self.reach is None else self.reach

    @property
    def fresnel_number(self) -> float:
        return self.radius**2 / (self.wavelength * self.distance)

    @property
    def waves(self) -> float:
        """Upper bound [waves] on phases: (longest pupil-to-window path - distance)/λ + radius · `phase_band_inside`."""
        reach = self.radius + self.window.half_diagonal
        path = reach**2 / (math.hypot(reach, self.distance) + self.distance) / self.wavelength
        return path + self.radius * self.phase_band_inside

    @property
    def steepest_sine(self) -> float:
        """Largest sine of the rays that meet in a point of the window; see `scalar_theory.steepest_sine`."""
        straight = self.radius / math.hypot(self.radius, self.distance)
        slopes = float((self.stack if self.pixelated is None else self.stack.level).slopes.steepest[0])
        if SLOPE_MARGIN * slopes >= straight * self.medium_n:
            return straight  # all slopes and finer detail can only increase the sine of light that leaves the pupil
        band = SLOPE_MARGIN * slopes / self.light.wavelength + self.detail
        return steepest_sine(self.radius, self.distance, (band + 1 / self.radius) * self.wavelength)

    @property
    def scalar_error(self) -> float:
        """Upper bound on the error of scalar theory."""
        return scalar_theory_error(self.steepest_sine, self.spread)

    def soft_edge(self, band: float) -> PupilEdge:
        """Return the aperture with a softened edge; its spectrum is unchanged at frequencies up to `band` [1/m]."""
        return PupilEdge(self.aperture.soften(stepped_up(band * self.radius), self.ripple, EDGE_REACH), self.radius)

    def band(self, margin: float = 0.0) -> float:
        """Return the highest frequency [1/m] at which the pupil's light can land within `margin` [m] of the window."""
        edge = 0.0 if self.steep else EDGE_REACH
        reach = (1 + edge) * self.radius + self.outermost + margin
        return min(self.widest_band, reach / math.hypot(reach, self.distance) / self.wavelength)


@lru_cache(maxsize=256)
def _differentiated(beam: Beam, window: Grid, tolerance: float, dtype: str, knots: DerivativeKnots | None) -> Problem:
    part = DETAIL_PART / (1 if knots else FINER_DETAIL)
    return replace(_problem(beam, window, tolerance, dtype, part), differentiated=True, knots=knots)


@lru_cache(maxsize=256)
def _problem(beam: Beam, window: Grid, tolerance: float, dtype: str, part: float = DETAIL_PART) -> Problem:
    pupil, wavelength = beam.pupil, beam.wavelength
    on_axis = beam.source.angle == (0.0, 0.0)
    return Problem(
        light=beam,
        aperture=beam.aperture,
        radius=pupil.radius,
        wavelength=wavelength / beam.index,
        distance=beam.distance,
        window=window,
        symmetric=pupil.rotationally_symmetric(wavelength) and on_axis,
        tolerance=tolerance,
        dtype=dtype,
        masked=pupil.mask is not None,
        medium_n=beam.index,
        spread=light_spread(pupil),
        even=on_axis and window.centre == (0.0, 0.0) and pupil.mirror_symmetric(wavelength),
        detail_part=part,
    )
