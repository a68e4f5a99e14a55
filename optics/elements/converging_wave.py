"""A wave that converges on a point of an image plane, sampled by another optics program."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from optics.elements.pupil_rim import Rim, rim_around
from optics.numerics.arguments import complexes, is_sized, positive, shown
from optics.numerics.grid import sample_positions
from optics.numerics.number_types import full_precision

__all__ = ["ConvergingWave", "is_of_rays", "is_of_samples", "of_rays", "of_samples"]

MM, UM = 1e-3, 1e-6
# Choice: part of the pupil's size within which samples must be evenly illuminated, and rays have light.
INSIDE = 0.9
LIT = 1e-3  # choice: smallest intensity of an illuminated sample, relative to the brightest one
# If the rim covers part of a sample, the sample's centre lies inside when it keeps more than half of the amplitude.
HALF = 0.5
EVEN = 0.1  # choice: tolerance on amplitudes in the part INSIDE of the pupil, relative to their median
ON_Z = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class ConvergingWave:
    """Samples of a wave that converges on a point of the image plane.

    The samples were read from an object of another optics program. The wavefront is compared with the reference sphere,
    whose centre is this point.

    sines: directions from the point to the samples, as the components of unit vectors along the axes x and y of the
        image plane, array (axis, sample).
    ahead: distance [m] by which the wavefront is ahead of the sphere, times the refractive index, array (sample,).
    rim: rim of the pupil as seen from the point, in the same coordinates as `sines`.
    on_plane: rim [m] of the pupil on the pupil's plane, which lies `distance` in front of the image.
    distance: radius of the sphere [m].
    wavelength: vacuum wavelength [m].
    position: the point (x, y) [m] on the image plane; None if the other program's object does not contain it.
    height: distance [m] from the origin of the object's coordinates to the image plane, perpendicular to the plane and
        positive in the direction of the light; None if the object does not contain it.
    """

    sines: np.ndarray
    ahead: np.ndarray
    rim: Rim
    on_plane: Rim
    distance: float
    wavelength: float
    position: tuple[float, float] | None = None
    height: float | None = None

    @property
    def pupil_points(self) -> np.ndarray:
        """Positions of the samples on the plane of the pupil, in units of its radius, (2, n)."""
        sines = self.sines - self.rim.middle[:, None]
        found: np.ndarray = self.distance / self.on_plane.radius * sines / np.sqrt(1 - np.sum(sines**2, axis=0))
        return found

    def moved(self, shift: float, medium_n: float, position: tuple[float, float] | None = None) -> ConvergingWave:
        """Return the same wave, compared with a reference sphere around another point.

        The present reference sphere is centred on the point of the image plane on which the wave converges.

        shift: distance [m] by which the image plane is moved, positive in the direction of the light.
        medium_n: refractive index behind the pupil.
        position: the new centre (x, y) [m], on the moved image plane. None: the point at which the ray from the pupil's
            centre to the present centre crosses the moved plane.

        Raises:
            ValueError: a new centre is given although the present centre is unknown.
        """
        if position is not None and self.position is None:
            raise ValueError("the position of the image is unknown: this object does not contain it")
        middle = self.rim.middle
        x, y = -shift * middle / math.sqrt(1 - float(middle @ middle))
        if self.position is not None:
            position = position or (self.position[0] + x, self.position[1] + y)
            x, y = np.subtract(position, self.position)
        sines, apart = self._seen_from(np.array([[x], [y], [shift]]), self.sines)
        centre, (distance,) = self._seen_from(np.array([[x], [y], [shift]]), middle[:, None])
        rim = replace(self.rim, middle=centre[:, 0], radius=self.rim.radius * self.distance / float(distance))
        ahead = self.ahead - medium_n * (apart - distance)
        height = None if self.height is None else self.height + shift
        moved = {"sines": sines, "ahead": ahead, "rim": rim, "distance": float(distance)}
        return replace(self, position=position, height=height, **moved)

    def _seen_from(self, to: np.ndarray, sines: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the directions and the distances [m] from another point to points of the reference sphere.

        The directions are components of unit vectors along x and y, array (axis, point).

        to: the other point (x, y, z) [m] relative to the sphere's centre, with z along the light, (3, 1).
        sines: the directions from the sphere's centre to the points, array (axis, point).
        """
        away = self.distance * np.stack([*sines, -np.sqrt(1 - np.sum(sines**2, axis=0))]) - to
        apart = np.linalg.norm(away, axis=0)
        return away[:2] / apart, apart


def is_of_rays(system: Any) -> bool:
    return all(hasattr(system, name) for name in ("pupil_x", "pupil_y", "pupil_z", "opd", "radius"))


def is_of_samples(system: Any) -> bool:
    return all(hasattr(system, name) for name in ("data", "dx", "wavelength"))


def of_rays(system: Any, wavelength: float, image_normal: Any) -> ConvergingWave:
    """Return the converging wave whose rays through a pupil are listed by an object of another optics program.

    system: the object, such as optiland's WavefrontData. Its attributes are pupil_x, pupil_y, pupil_z and radius [mm],
        and opd [waves].
    wavelength: vacuum wavelength [m].
    image_normal: normal of the image plane in the object's coordinates. None: the z axis. The x axis of the image plane
        is the projection of the object's x axis.

    Raises:
        ValueError: a number of the object or the normal is invalid, the attributes have different lengths, no ray has
            light, the sphere through the samples has a radius other than the attribute `radius`, the samples lie on a
            line, the pupil is obscured or not convex, or a pupil that is neither a circle nor an ellipse is sampled too
            coarsely.
    """
    normal = _unit(ON_Z if image_normal is None else image_normal)
    x, y, z, opd, intensity = _alike(system)
    places = np.stack([x, y, z]) * MM
    ahead = opd * wavelength  # opd is the chief ray's path minus the ray's path, so positive values are ahead
    light = np.nan_to_num(intensity)
    known = np.isfinite(places).all(axis=0) & np.isfinite(ahead)
    lit = known & (light > LIT * light.max(initial=0.0))
    if not lit.any():
        raise ValueError("intensity: no ray has positive intensity and finite position and path: at least one must")
    radius = abs(_one("radius", system.radius)) * MM
    given = getattr(system, "reference_center", None)
    centre = _centre(places[:, lit], radius) if given is None else _point("reference_center", given) * MM
    right = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(normal, right)])
    away = places - centre[:, None]
    sines = axes @ away / np.linalg.norm(away, axis=0)
    position = float(axes[0] @ centre), float(axes[1] @ centre)
    height = float(normal @ centre) * (-1.0 if (normal @ away[:, lit]).mean() > 0 else 1.0)
    dark = sines[:, known & ~lit]
    rim = rim_around(sines[:, lit], dark)
    if rim.contains(dark[0], dark[1], INSIDE).any():
        raise ValueError("the pupil is obscured or not convex: only unobscured, convex pupils can be read")
    return ConvergingWave(sines[:, lit], ahead[lit], rim, rim.onto_plane(radius), radius, wavelength, position, height)


def of_samples(system: Any, wavelength: float, distance: float) -> ConvergingWave:
    """Return the converging wave whose samples on a grid in a pupil are stored in an object of another optics program.

    system: the object, such as prysm's Wavefront. Its attributes are data (complex), dx [mm] and wavelength [µm]. The
        samples in `data` lie on a plane that is parallel to the image plane.
    wavelength: vacuum wavelength [m], which must be equal to the object's wavelength.
    distance: distance [m] of the samples from the image plane.

    Raises:
        ValueError: the wavelengths differ, dx is not positive, the data are not finite or not two-dimensional, the
            illuminated samples lie on a line, the pupil is dark, obscured, not convex or unevenly illuminated, or a
            pupil that is neither a circle nor an ellipse is sampled too coarsely.
    """
    data, own = complexes("data", system.data), _one("wavelength", system.wavelength)
    pitch = positive("dx", _one("dx", system.dx), "mm") * MM
    if data.ndim != 2 or data.size == 0 or not np.isfinite(data).all():
        raise ValueError(f"data has shape {data.shape}: must be a plane of finite complex numbers")
    if not np.isclose(own * UM, wavelength, rtol=1e-6):
        raise ValueError(f"wavelength = {wavelength:g} m: the object's is {own:g} µm")
    amplitude = np.abs(data)
    illuminated = amplitude > np.sqrt(LIT) * amplitude.max()
    if not illuminated.any():
        raise ValueError("data is dark everywhere: must hold the pupil's light")
    y, x = (sample_positions(n, pitch) for n in data.shape)
    lit = amplitude > HALF * np.median(amplitude[illuminated])
    rows, columns = np.nonzero(lit)
    rim = rim_around(np.stack([x[columns], y[rows]]))
    within = amplitude[rim.contains(x[None, :], y[:, None], INSIDE)]
    middle = np.median(within) if within.size else 0.0
    if within.size and np.abs(within - middle).max() > EVEN * middle:
        raise ValueError("data: the pupil is obscured, not convex, or unevenly lit: only unobscured pupils can be read")
    at = np.stack([x[columns], y[rows]]) - rim.middle[:, None]
    ahead = -_unwrapped(data, illuminated)[lit] * wavelength / (2 * np.pi)
    sines, on_plane = at / np.hypot(distance, np.hypot(*at)), replace(rim, middle=np.zeros(2))
    return ConvergingWave(sines, ahead, rim.in_sines(distance), on_plane, distance, wavelength)


def _alike(system: Any) -> list[np.ndarray]:
    """Return pupil_x, pupil_y, pupil_z, opd and intensity (1 if missing) of all rays, one flat array each.

    Raises:
        ValueError: the attributes have different lengths, or contain something other than real numbers.
    """
    found = {name: _flat(name, getattr(system, name)) for name in ("pupil_x", "pupil_y", "pupil_z", "opd")}
    rays = len(found["pupil_x"])
    found["intensity"] = _flat("intensity", getattr(system, "intensity", np.ones(rays)))
    for name, values in found.items():
        if len(values) != rays:
            raise ValueError(f"{name} has {len(values)} numbers: must have one for each ray, {rays} as pupil_x")
    return list(found.values())


def _centre(places: np.ndarray, radius: float) -> np.ndarray:
    """Return the centre of the sphere through the points (3, n); ValueError if its radius is not about `radius`."""
    matrix = np.concatenate([2 * places, np.ones((1, places.shape[1]))]).T
    found = np.linalg.lstsq(matrix, np.sum(places**2, axis=0), rcond=None)[0][:3]
    if not np.isclose(np.linalg.norm(places - found[:, None], axis=0).mean(), radius, rtol=0.05):
        raise ValueError(f"radius = {radius:.3g} m: the samples lie on another sphere")
    return np.asarray(found)


def _unwrapped(data: np.ndarray, lit: np.ndarray) -> np.ndarray:
    """Return the phase [rad], unwrapped along the column with the most illuminated samples, then along every row."""
    phase, middle = np.where(lit, np.angle(data), 0.0), int(lit.sum(axis=0).argmax())
    phase[:, middle] = np.unwrap(phase[:, middle])
    right, left = np.unwrap(phase[:, middle:], axis=1), np.unwrap(phase[:, middle::-1], axis=1)[:, ::-1]
    return np.concatenate([left[:, :-1], right], axis=1)


def _flat(name: str, values: Any) -> np.ndarray:
    """Convert an array or a tensor to a flat float64 array; ValueError about `name` unless it contains real numbers."""
    values = full_precision(name, values)
    plain = values.detach().cpu().numpy() if hasattr(values, "detach") else values
    try:
        return np.atleast_1d(np.asarray(plain, dtype=np.float64)).ravel()
    except (TypeError, ValueError):
        raise ValueError(f"{name} = {shown(values)}: must be real numbers") from None


def _one(name: str, value: Any) -> float:
    """Return a number, or the first number of an array; ValueError about `name` if it is 0 or not finite."""
    found = _flat(name, value)
    if value is None or found.size == 0 or not abs(found[0]) > 0 or not np.isfinite(found[0]):
        raise ValueError(f"{name} = {shown(value)}: must be a finite number that is not 0")
    return float(found[0])


def _point(name: str, given: Any) -> np.ndarray:
    found = np.concatenate([_flat(name, at)[:1] for at in given]) if is_sized(given) and len(given) else np.empty(0)
    if len(found) != 3 or not np.isfinite(found).all():
        raise ValueError(f"{name} = {shown(given)}: must be three finite lengths (x, y, z)")
    return found


def _unit(given: Any) -> np.ndarray:
    found = _point("image_normal", given)
    if not abs(found[2]) > 0:
        raise ValueError(f"image_normal = {shown(given)}: must have a component along z, the optical axis")
    return np.asarray(found / np.linalg.norm(found) * np.sign(found[2]))
