"""Lenses from other programs: exit pupil and wavefront, read from the attributes of the programs' objects."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from optics.elements.converging_wave import UM, ConvergingWave, is_of_rays, is_of_samples, of_rays, of_samples
from optics.elements.pupil import Pupil
from optics.elements.refractive_index import Dispersion, index_of
from optics.elements.wavefront import Zernike, mode
from optics.numerics.arguments import in_range, point_2d, positive, vacuum_wavelength, whole
from optics.numerics.autodiff import number

__all__ = ["ExitPupil", "read_exit_pupil"]

RAYS_PER_MODE = 3  # choice
# Choice: a central disk of 0.4 of the radius must contain at least 0.25 of the rays that an even distribution would
# have there. Rays in concentric rings pass this test with any number of rings.
CENTRE, FILLED = 0.4, 0.25
# Choice: weight of the wavefront's mean square over the whole circle, relative to the mean square of the residual. It
# bounds the wavefront where an ellipse or polygon leaves the circle dark, and changes modes of a full circle by less
# than 1e-6.
BOUNDED = 1e-3
RMS_DIGITS = 8.0


@dataclass(frozen=True, eq=False)
class ExitPupil:
    """The exit pupil of a lens and the wavefront in it, both computed by another optics program.

    Both were read from an object of that program, such as optiland's WavefrontData or prysm's Wavefront. The wavefront
    is relative to the reference sphere, whose centre is the image point in that program.

    pupil: an ideal lens focused on the centre of the reference sphere, with the wavefront as Zernike modes. Its PSF at
        `distance` has the axes of the image plane, and the PSF's origin is the centre of the sphere.
    distance: radius [m] of the reference sphere.
    residual: root mean square [m] of the difference between the wavefront and the fitted Zernike modes.
    position: centre (x, y) [m] of the sphere. x and y are measured along the image plane, from the other program's
        origin of coordinates. None if the program's object does not contain this position, as with prysm's Wavefront.
    sines: direction of the ray from the pupil's centre to the centre of the sphere, as the components (x, y) of its
        unit vector along the image plane. (0, 0): perpendicular to the image plane.
    wave: the samples from the other program.
    order: highest radial order of the Zernike modes.
    """

    pupil: Pupil
    distance: float
    residual: float
    position: tuple[float, float] | None
    sines: tuple[float, float]
    wave: ConvergingWave = field(repr=False)
    order: int = field(repr=False)

    @cached_property
    def rms(self) -> float:
        """Root mean square of the wavefront [m] over the pupil, without piston and tilt."""
        waves = self.pupil.wavefront
        assert isinstance(waves, Zernike)
        nodes = self.pupil.aperture.nodes(2.0 * max(1, waves.order), RMS_DIGITS)
        weight = np.sqrt(nodes.weight / nodes.weight.sum())
        flat = np.stack([np.ones_like(nodes.x), nodes.x, nodes.y], axis=1) * weight[:, None]
        values = waves.at(nodes.x, nodes.y) * weight
        return float(np.linalg.norm(values - flat @ np.linalg.lstsq(flat, values, rcond=None)[0]))

    @cached_property
    def spot_radius(self) -> float:
        """Largest distance [m] from the origin at which a ray of the fitted wavefront hits the image plane.

        A ray is displaced by the gradient of the wavefront, times the radius of the reference sphere and divided by the
        refractive index.
        """
        waves, step = self.pupil.wavefront, 1e-4
        assert isinstance(waves, Zernike)
        x, y = self.wave.pupil_points
        slopes = [
            (waves.at(x + dx, y + dy) - waves.at(x - dx, y - dy)) / (2 * step) for dx, dy in ((step, 0.0), (0.0, step))
        ]
        index = self.pupil.index_behind(self.wave.wavelength)
        return float(np.hypot(*slopes).max()) * self.distance / self.pupil.radius / index

    @property
    def image_height(self) -> float:
        """Distance [m] of the image plane from the origin of coordinates in the optics program that computed the lens.

        The distance is measured perpendicular to the plane. It is positive if the plane lies behind the origin, in the
        direction of the light. It is read from an object of that program, such as optiland's WavefrontData.

        Raises:
            ValueError: the object does not contain this distance, as with prysm's Wavefront.
        """
        if self.wave.height is None:
            raise ValueError("the position of the image plane is unknown: this object does not contain it")
        return self.wave.height

    def moved(self, shift: float, origin: tuple[float, float] | None = None) -> ExitPupil:
        """Return the exit pupil for a parallel image plane, `shift` [m] farther along the light.

        To compute PSFs out of focus, move the image plane in this way. Light that arrives at an angle then also moves
        along the plane. `optics.psf` at another sensor distance would ignore this movement.

        origin: point (x, y) [m] of the image plane that becomes the origin of the PSF. If it is the same at several
            wavelengths, the PSFs show the lens's lateral colour. None: the point that the ray through the pupil's
            centre hits.

        Raises:
            ValueError: an argument is not finite, the shift is longer than half the distance to the pupil, or an origin
                is given although the position of the image is unknown.
        """
        in_range("shift", shift, -self.distance / 2, self.distance / 2)
        index = number(index_of("medium_n", self.pupil.medium_n).at(self.wave.wavelength))
        place = None if origin is None else point_2d("origin", origin, "lengths (x, y) [m]")
        return _fitted(self.wave.moved(shift, index, place), self.pupil.medium_n, self.order)


def read_exit_pupil(
    system: Any,
    wavelength: float,
    medium_n: float = 1.0,
    focal_length: float | None = None,
    order: int = 8,
    image_normal: tuple[float, float, float] | None = None,
) -> ExitPupil:
    """Convert a lens from another program to a pupil with a wavefront.

    The pupil is a circle, an ellipse or, if a lens mount cuts off part of the light, a convex polygon. The light may
    reach the image plane at an angle. The PSF then refers to this plane. For this purpose, a position in the pupil is
    given by the direction of its ray. The coordinates are the components of the ray's unit vector along the plane,
    minus those of the ray through the pupil's centre.

    system: an object of one of two kinds. The first has pupil_x, pupil_y, pupil_z, radius [mm] and opd [waves], like
        optiland's WavefrontData with any distribution of rays. The second has data (complex), dx [mm] and wavelength
        [µm], like prysm's Wavefront in a pupil. Its phase must change by less than half a wave between samples.
    wavelength: vacuum wavelength [m].
    medium_n: refractive index of the image space.
    focal_length: distance from pupil to image [m], required for objects of the second kind. Objects of the first kind
        contain this distance.
    order: highest radial order of the fitted Zernike modes.
    image_normal: normal (x, y, z) of the image plane in the object's coordinates. None: the z axis, which is the axis
        of the lens. Objects of the second kind contain no directions; their image plane is parallel to the pupil.

    Raises:
        ValueError: the object has neither set of attributes, an argument is invalid or not supported by the object,
            there are too few samples, or the pupil is obscured, not convex or unevenly illuminated.
    """
    vacuum_wavelength(wavelength)
    count = whole("order", order, 1, 30)
    if is_of_rays(system):
        wave = of_rays(system, wavelength, image_normal)
    elif is_of_samples(system):
        if focal_length is None:
            raise ValueError("focal_length is missing: this object does not contain the distance [m] of its image")
        if image_normal is not None:
            raise ValueError("image_normal: must be left out, because this object does not contain directions of light")
        wave = of_samples(system, wavelength, positive("focal_length", focal_length))
    else:
        raise ValueError(
            f"system = {type(system).__name__}: must have pupil_x, pupil_y, pupil_z, opd and radius (optiland's "
            "WavefrontData), or data, dx and wavelength (prysm's Wavefront)"
        )
    return _fitted(wave, medium_n, count)


def _fitted(wave: ConvergingWave, medium_n: float | Dispersion, order: int) -> ExitPupil:
    """Return the exit pupil with Zernike modes fitted to the samples of a wave.

    Raises:
        ValueError: there are too few samples for the modes, or hardly any in the middle of the pupil.
    """
    modes = [(n, m) for n in range(order + 1) for m in range(-n, n + 1, 2)]
    if wave.ahead.size < RAYS_PER_MODE * len(modes):
        raise ValueError(f"{wave.ahead.size} samples of the wavefront: must be {RAYS_PER_MODE * len(modes)} or more")
    x, y = wave.pupil_points
    if np.mean(np.hypot(x, y) < CENTRE) < FILLED * CENTRE**2:
        raise ValueError("the pupil is obscured: only unobscured pupils can be read")
    basis = np.stack([mode(n, m, x, y) for n, m in modes], axis=1)
    ahead = wave.ahead - wave.ahead.mean()
    bounds = BOUNDED * np.sqrt(len(x)) * np.eye(len(modes))
    found = np.linalg.lstsq(np.concatenate([basis, bounds]), np.append(ahead, np.zeros(len(modes))), rcond=None)[0]
    residual = float(np.sqrt(np.mean(np.square(ahead - basis @ found))))
    waves = Zernike({key: float(value) / UM for key, value in zip(modes, found, strict=True) if key != (0, 0)})
    pupil = Pupil(
        wave.on_plane.radius,
        medium_n=medium_n,
        thin_lens_focal_length=wave.distance,
        aperture=wave.on_plane.aperture,
        wavefront=waves,
    )
    sines = float(-wave.rim.middle[0]), float(-wave.rim.middle[1])
    return ExitPupil(pupil, wave.distance, residual, wave.position, sines, wave, order)
