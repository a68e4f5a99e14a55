"""The pupil: an aperture with a relief, a wavefront, a mask, and an ideal lens."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from optics.apertures.aperture import Aperture
from optics.apertures.circular import Circle
from optics.elements.pixel_relief import PixelRelief
from optics.elements.pupil_path import lens_path, relief_height, wavefront_ahead
from optics.elements.pupil_slopes import all_slopes
from optics.elements.refractive_index import Dispersion, index_of, material
from optics.elements.relief import HeightMap, Relief
from optics.elements.source import PointSource
from optics.elements.transmittance import Mask
from optics.elements.wavefront import Aberration
from optics.elements.wavefront_slopes import Slopes
from optics.numerics.arguments import finite, of_kind, positive, reals
from optics.numerics.array_library import like
from optics.numerics.autodiff import Array, Scalar, is_differentiable, number
from optics.numerics.precision import precision

__all__ = ["MIDDLE", "Pupil"]

TALLEST = 100.0  # choice, radii: highest relief to which the thin-element model applies
ANY_HEIGHT, OTHER_UNIT = 1e-3, 0.05  # choices [m]: relief that is always allowed; relief that looks like another unit
LEVEL, TRANSMISSION_DIGITS = 1e-6, 9.0  # choice: neglected level of a mask's spectrum; digits of its transmission
MIDDLE = 550e-9  # choice [m]: wavelength that defines the image distance
SENSOR_DISTANCE = 240e-6  # choice [m]: default distance of the sensor behind a pupil without a lens


@dataclass(frozen=True, eq=False)
class Pupil:
    """A thin element with the amplitude transmittance A(x, y) M(x, y) exp(ik [(n - object_n) h(x, y) - W(x, y)]).

    k is 2π/λ, where λ is the vacuum wavelength.

    aperture_radius: R [m].
    height: h [m]: None (no relief), any Relief, or samples at cell centres over [-R, R]² (HeightMap), array (y, x).
    n: refractive index of the relief, constant or dispersive.
    medium_n: refractive index behind the pupil, constant or dispersive (`optics.medium`).
    object_n: refractive index in front of the pupil and around the relief. None: equal to medium_n.
    thin_lens_focal_length: focal length f [m] of an additional ideal lens, exp(-ik medium_n (√(r² + f²) - f)) at the
        distance r from the axis. It focuses parallel light of every wavelength at the distance f behind it. If f is
        negative, this factor is the complex conjugate of the factor for |f|, and the lens diverges.
    aperture: A, which is 1 in the opening and 0 elsewhere. Circle (default), Annulus, Rings, Polygon, Slit, or a
        `union`, `difference` or `intersection` of shapes.
    wavefront: W [m in vacuum], the same at every wavelength: a Zernike or WavefrontMap that covers the pupil.
    mask: M, the transmitted amplitude: GaussianMask or MaskMap. A PSF is relative to the light that falls on the open
        aperture, so absorption in a mask reduces the PSF's sum.

    These may carry derivatives, as Dr.Jit arrays (samples: Dr.Jit tensors) or, for `optics.torch.psf`, as PyTorch
    tensors: aperture_radius, height, n, thin_lens_focal_length, W's coefficients or samples, and M's waist or samples.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """

    aperture_radius: Scalar
    height: Any = None
    n: Scalar | Dispersion = 1.5
    medium_n: float | Dispersion = 1.0
    thin_lens_focal_length: Scalar | None = None
    aperture: Aperture = field(default_factory=Circle)
    wavefront: Aberration | None = None
    mask: Mask | None = None
    object_n: float | Dispersion | None = None

    def __post_init__(self) -> None:
        positive("aperture_radius", self.aperture_radius, carried=True)
        index_of("medium_n", self.medium_n)
        if self.object_n is not None:
            index_of("object_n", self.object_n)
        object.__setattr__(self, "n", material("n", self.n))
        of_kind("aperture", self.aperture, Aperture, "Circle(), or union(Disk(0.5, (0.4, 0.0)))")
        if self.mask is not None:
            self._check_reach("mask", of_kind("mask", self.mask, Mask, "GaussianMask(20e-6)").radius)
        if self.height is not None and not isinstance(self.height, Relief):
            height = self.height if is_differentiable(self.height) else reals("height", self.height)
            object.__setattr__(self, "height", HeightMap(height))
        if self.height is not None and (span := self.height.span) > max(TALLEST * self.radius, ANY_HEIGHT):
            unit = "radians or micrometres" if span < 50 else "nanometres"
            looks = f", as if in {unit}" if span > OTHER_UNIT else ""
            raise ValueError(
                f"height spans {span:.3g} m over a pupil of radius {self.radius:.3g} m{looks}: must be in metres, at "
                f"most {TALLEST:g} radii or {ANY_HEIGHT:g} m (a phase φ [rad] is a height φ λ / (2π (n - object_n)))"
            )
        if self.wavefront is not None:
            self._check_wavefront(of_kind("wavefront", self.wavefront, Aberration, "Zernike({(2, 0): 0.1})"))
        if self.thin_lens_focal_length is not None:
            focal = finite("thin_lens_focal_length", self.thin_lens_focal_length, carried=True)
            positive("abs(thin_lens_focal_length)", abs(focal))

    def _check_wavefront(self, wavefront: Aberration) -> None:
        self._check_reach("wavefront", wavefront.radius)
        most = max(TALLEST * number(self.aperture_radius), ANY_HEIGHT)
        if wavefront.span > most:
            raise ValueError(
                f"wavefront spans {wavefront.span:.3g} m: must be at most {most:.3g} m "
                "(Zernike's coefficients are in µm, a map's samples in m)"
            )

    def _check_reach(self, name: str, known: float | None) -> None:
        if known is not None and known < number(self.aperture_radius) * (1 - 1e-9):
            raise ValueError(
                f"{name} is known over a radius of {known:.3g} m: must be the pupil's, "
                f"{number(self.aperture_radius):.3g} m, or more"
            )

    @cached_property
    def radius(self) -> float:
        """Radius of the aperture [m], without derivative."""
        return number(self.aperture_radius)

    @property
    def area(self) -> float:
        """Open area [m²]."""
        return self.aperture.area * self.radius**2

    @property
    def transmission(self) -> Scalar:
        """Fraction of the light on the open aperture that the mask transmits, with derivatives; 1 without a mask."""
        # Nothing is cached: a graph allows one backward pass, and gradients of Dr.Jit numbers may be enabled later.
        if is_differentiable(self.aperture_radius) or not (self.mask is None or self.mask.plain):
            import drjit as dr

            found = self._let_through()
            return found if dr.grad_enabled(found) else number(found)
        return self._transmission

    @cached_property
    def _transmission(self) -> float:
        return number(self._let_through())

    def _let_through(self) -> Scalar:
        if self.mask is None:
            return 1.0
        import drjit as dr

        types = precision("float64")
        nodes = self.aperture.nodes(2 * self.mask.bandwidth(LEVEL, self.radius) * self.radius, TRANSMISSION_DIGITS)
        amplitude = self.amplitude(types.Float64(nodes.x), types.Float64(nodes.y))
        return dr.sum(types.Float64(nodes.weight) * dr.square(amplitude)) / self.aperture.area

    def amplitude(self, x: Array, y: Array) -> Array:
        """Return the mask's amplitude at x, y [units of the radius], arrays as in `Relief.height`; 1 without a mask."""
        if self.mask is None:
            return like(x, 1.0)
        radius = like(x, self.aperture_radius)
        return self.mask.amplitude(x * radius, y * radius, self.aperture_radius)

    @property
    def pixels(self) -> int:
        """Number of pixels across the relief; 0 unless its square pixels differ in height or carry derivatives."""
        return 0 if self.height is None else int(self.height.pixels)

    def image_distance(self, source_distance: float) -> float:
        """Return the default distance [m] of the sensor behind the pupil, a number that carries no derivatives.

        Without a lens it is 240 µm. With a lens it is the image distance z for a source at a distance s, 1/z = 1/f -
        n₀/(n s). The indices n₀ in front of the pupil and n behind it are those at 550 nm.

        source_distance: s [m]; infinity for parallel light.

        Raises:
            ValueError: the lens forms no real image, or source_distance is not positive or carries a derivative.
        """
        positive("source_distance", source_distance, infinite=True)
        if self.thin_lens_focal_length is None:
            return SENSOR_DISTANCE
        before = self.index_before(MIDDLE) / self.index_behind(MIDDLE)
        power = 1 / number(self.thin_lens_focal_length) - before / source_distance
        if power <= 0:
            raise ValueError(
                f"sensor_distance is missing: a lens of focal length {number(self.thin_lens_focal_length):.3g} m "
                f"makes no real image of a source at {source_distance:.3g} m, so specify the sensor's distance [m]"
            )
        return 1 / power

    def index_behind(self, wavelength: float) -> float:
        """Return the index between pupil and sensor at a vacuum wavelength [m]; ValueError as in `Dispersion.at`."""
        return self._index("medium_n", wavelength)

    def index_before(self, wavelength: float) -> float:
        """Return the index between source and pupil at a vacuum wavelength [m]; ValueError as in `Dispersion.at`."""
        if self.object_n is None:
            return self.index_behind(wavelength)
        return self._index("object_n", wavelength)

    def _index(self, name: str, wavelength: float) -> float:
        """Return the refractive index of a medium. It is cached, because every PSF evaluates it many times."""
        known = self._indices
        if (name, wavelength) not in known:
            known[name, wavelength] = number(index_of(name, getattr(self, name)).at(wavelength))
        return known[name, wavelength]

    @cached_property
    def _indices(self) -> dict[tuple[str, float], float]:
        return {}

    @cached_property
    def level(self) -> Pupil:
        """The same pupil without its relief."""
        return replace(self, height=None)

    def index_step(self, wavelength: float) -> Scalar:
        """Return the relief's refractive index n(λ) minus the index of the medium in front of the pupil."""
        return self.n.step(wavelength, self.index_before(wavelength))

    def bends(self, wavelength: float) -> bool:
        """Return True if there is a relief and its `index_step` is not 0 or carries a derivative."""
        step = self.index_step(wavelength)
        return self.height is not None and (is_differentiable(step) or step != 0)

    def rotationally_symmetric(self, wavelength: float) -> bool:
        """Return True if rotation keeps the transmittance and the derivatives that it carries; False if unknown."""
        relief_is = not self.bends(wavelength) or self.height.rotationally_symmetric
        wavefront_is = self.wavefront is None or self.wavefront.rotationally_symmetric
        mask_is = self.mask is None or self.mask.rotationally_symmetric
        return self.aperture.rotationally_symmetric and relief_is and wavefront_is and mask_is

    def mirror_symmetric(self, wavelength: float) -> bool:
        """Return True if x → -x and y → -y each keep the transmittance and derivatives it carries; False if unknown."""
        relief_is = not self.bends(wavelength) or self.height.mirror_symmetric
        wavefront_is = self.wavefront is None or self.wavefront.rotationally_symmetric
        mask_is = self.mask is None or self.mask.rotationally_symmetric
        return self.aperture.mirror_symmetric and relief_is and wavefront_is and mask_is

    def path(self, x: Array, y: Array, wavelength: float, source: PointSource) -> Array:
        """Return the optical path [m] from the source through points (x, y) [m], arrays as in `Relief.height`.

        It is relative to the path through the centre of the same pupil without its relief and wavefront.
        """
        total = source.path(x, y) * like(x, self.index_before(wavelength))
        if self.thin_lens_focal_length is not None:
            total = total - lens_path(self.thin_lens_focal_length, x, y) * like(x, self.index_behind(wavelength))
        if self.bends(wavelength):
            total = total + like(x, self.index_step(wavelength)) * relief_height(self, x, y)
        return total if (ahead := wavefront_ahead(self, x, y)) is None else total - ahead

    def slopes(self, wavelength: float, source: PointSource) -> Slopes:
        """Return the gradient of `path` over the pupil's disk and soft edge; reliefs of square pixels count as flat."""
        # The path depends on the wavelength only through these indices. Equal indices therefore give equal slopes.
        indices = number(self.index_step(wavelength)), self.index_before(wavelength), self.index_behind(wavelength)
        same = self._first_with.setdefault(indices, wavelength)
        level = self.level if self.pixels else self
        return all_slopes(level, same, number(source.distance), source.plain.angle, self.pieces(same))

    def pieces(self, wavelength: float) -> int:
        """Return the number of polynomial pieces across the relief or across the wavefront, whichever number is larger.

        The number is 0 for a missing wavefront or relief, and for a relief that does not bend light of this wavelength.
        """
        pieces = [self.height.knots if self.bends(wavelength) else 0]
        pieces += [0 if self.wavefront is None else self.wavefront.knots]
        return max(pieces)

    @cached_property
    def _first_with(self) -> dict[tuple[float, float, float], float]:
        """The first wavelength passed to `slopes` for each set of refractive indices. The set determines the slopes."""
        return {}

    def scatter(self, wavelength: float, share: float) -> float:
        """Return the frequency [1/m] along x and y beyond which at most a fraction `share` of the light is scattered.

        It is the sum of one such frequency for the relief, one for the wavefront, and one for the mask, without slopes.
        By Carson's rule, the whole bandwidth is this sum plus the largest ray slope divided by wavelength.
        """
        bends, found = self.bends(wavelength), 0.0
        rough = sum(p is not None and p.scatters for p in (self.height if bends else None, self.wavefront))
        each = share / max(1, rough + (self.mask is not None))
        of_disk = each * self.aperture.area / math.pi  # mean over the disk, not the opening
        turns, level = number(self.index_step(wavelength)) / wavelength, math.sqrt(of_disk) / (2 * math.pi)  # waves
        if bends and isinstance(self.height, PixelRelief):
            found += self.height.scatter(turns, self.aperture, each) / self.radius
        elif bends and turns != 0:
            found += self.height.detail(level / abs(turns)) / self.radius
        if self.wavefront is not None:
            own = self.radius if self.wavefront.radius is None else self.wavefront.radius
            found += self.wavefront.detail(level * wavelength, self.radius / own) / own
        light = 0.0 if self.mask is None else of_disk * number(self.transmission)
        return found if self.mask is None else found + self.mask.detail(light, self.radius)

    def bandwidth(self, wavelength: float, tolerance: float) -> float:
        """Return the spatial frequency [1/m] above which components of phase [rad] and of mask are below `tolerance`.

        A relief of square pixels is ignored, because its jumps are sampled separately.
        """
        level, step = tolerance * wavelength / (2 * np.pi), abs(number(self.index_step(wavelength)))
        found = 0.0
        if self.height is not None and step != 0 and not self.pixels:
            found = self.height.bandwidth(level / step) / self.radius
        if self.wavefront is not None:
            found = max(found, self.wavefront.bandwidth(level) / self.radius)
        return found if self.mask is None else found + self.mask.bandwidth(min(tolerance, 0.1), self.radius)
