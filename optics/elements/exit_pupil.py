"""Lenses from other programs: exit pupil and wavefront, read from the attributes of the programs' objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.elements.pupil import Pupil
from optics.elements.wavefront import Zernike, mode
from optics.numerics.arguments import complexes, is_sized, positive, shown, vacuum_wavelength, whole
from optics.numerics.grid import sample_positions
from optics.numerics.number_types import full_precision

__all__ = ["ExitPupil", "read_exit_pupil"]

MM, UM = 1e-3, 1e-6
SECTORS, ROUND = 8, 0.9  # choice: each of 8 sectors must contain light out to 0.9 of the pupil's radius
FULL = 0.8  # choice: fraction of the circle that the samples' hull must fill. A hexagon fills 0.83, a square 0.64.
NOT_ROUND = "the pupil is not round: only circles can be read"
RAYS_PER_MODE = 3  # choice
LIT = 1e-3  # choice: intensity from which on a sample counts as illuminated, relative to the brightest sample
# If the rim covers part of a sample, the sample's centre lies inside when it keeps more than half of the amplitude.
HALF = 0.5
EVEN = 0.1  # choice: tolerance on amplitudes within ROUND of the radius, relative to their median
# Choice: a central disk of 0.4 of the radius must contain at least 0.25 of the rays that an even distribution would
# have there. Rays in concentric rings pass this test with any number of rings.
CENTRE, FILLED = 0.4, 0.25


@dataclass(frozen=True, eq=False)
class ExitPupil:
    """An exit pupil with its wavefront.

    pupil: an ideal lens focused on the centre of the reference sphere, with the wavefront as Zernike modes.
    distance: distance [m] from the pupil to that centre, which is the image position in the other program.
    rms: root mean square of the wavefront [m] without piston and tilt.
    residual: root mean square [m] of the difference between wavefront and fit.
    """

    pupil: Pupil
    distance: float
    rms: float
    residual: float


def read_exit_pupil(
    system: Any, wavelength: float, medium_n: float = 1.0, focal_length: float | None = None, order: int = 8
) -> ExitPupil:
    """Convert a lens from another program to a pupil with a wavefront.

    system: an object of one of two kinds. The first has pupil_x, pupil_y, pupil_z, radius [mm] and opd [waves], like
        optiland's WavefrontData with any distribution of rays. The second has data (complex), dx [mm] and wavelength
        [µm], like prysm's Wavefront in a pupil. Its phase must change by less than half a wave between samples.
    wavelength: vacuum wavelength [m].
    medium_n: refractive index of the image space.
    focal_length: distance from pupil to image [m]. It is required if the object does not contain this distance (prysm).
    order: highest radial order of the fitted Zernike modes.

    Raises:
        ValueError: an object with neither set of attributes; too few samples; a pupil that is obscured, not round or
            unevenly illuminated; or an invalid argument.
    """
    vacuum_wavelength(wavelength)
    count = whole("order", order, 1, 30)
    if all(hasattr(system, name) for name in ("pupil_x", "pupil_y", "pupil_z", "opd", "radius")):
        x, y, ahead, distance = _of_rays(system, wavelength)
    elif all(hasattr(system, name) for name in ("data", "dx", "wavelength")):
        if focal_length is None:
            raise ValueError("focal_length is missing: this object does not contain the distance [m] of its image")
        distance = positive("focal_length", focal_length)
        x, y, ahead = _of_samples(system, wavelength)
    else:
        raise ValueError(
            f"system = {type(system).__name__}: must have pupil_x, pupil_y, pupil_z, opd and radius (optiland's "
            "WavefrontData), or data, dx and wavelength (prysm's Wavefront)"
        )
    return _fitted(x, y, ahead, distance, medium_n, count)


def _of_rays(system: Any, wavelength: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Return points (x, y) on the tangent plane, the wavefront there, and the radius of the reference sphere, all in m.

    The plane touches the reference sphere at the chief ray. A point of the sphere in direction θ is mapped to R tan θ
    on the plane, with R the sphere's radius. The wavefront is positive if it is ahead of the sphere.
    """
    x, y, z, opd, intensity = _alike(system)
    places = np.stack([x, y, z]) * MM
    ahead = opd * wavelength  # opd is the chief ray's path minus the ray's path, so positive values are ahead
    light = np.nan_to_num(intensity)
    lit = np.isfinite(places).all(axis=0) & np.isfinite(ahead) & (light > LIT * light.max(initial=0.0))
    if not lit.any():
        raise ValueError("intensity: no ray has positive intensity and finite position and path: at least one must")
    places, ahead = places[:, lit], ahead[lit]
    radius = abs(_one("radius", system.radius)) * MM
    given = getattr(system, "reference_center", None)
    centre = _centre(places, radius) if given is None else _point("reference_center", given) * MM
    away = places - centre[:, None]
    axis = away.mean(axis=1)
    axis /= np.linalg.norm(axis)
    across = np.array([1.0, 0.0, 0.0]) - axis[0] * axis
    across /= np.linalg.norm(across)
    along = away / np.abs(axis @ away) * radius
    return across @ along, np.cross(axis * np.sign(axis[2]), across) @ along, ahead, radius


def _alike(system: Any) -> list[np.ndarray]:
    """Return pupil_x, pupil_y, pupil_z, opd and intensity (1 if missing) of all rays, one flat array each."""
    found = {name: _flat(name, getattr(system, name)) for name in ("pupil_x", "pupil_y", "pupil_z", "opd")}
    rays = len(found["pupil_x"])
    found["intensity"] = _flat("intensity", getattr(system, "intensity", np.ones(rays)))
    for name, values in found.items():
        if len(values) != rays:
            raise ValueError(f"{name} has {len(values)} numbers: must have one for each ray, {rays} as pupil_x")
    return list(found.values())


def _centre(places: np.ndarray, radius: float) -> np.ndarray:
    """Return the centre of the sphere through the points. The centre lies behind them."""
    matrix = np.concatenate([2 * places, np.ones((1, places.shape[1]))]).T
    found = np.linalg.lstsq(matrix, np.sum(places**2, axis=0), rcond=None)[0][:3]
    if not np.isclose(np.linalg.norm(places - found[:, None], axis=0).mean(), radius, rtol=0.05):
        raise ValueError(f"radius = {radius:.3g} m: the samples lie on another sphere")
    return np.asarray(found)


def _of_samples(system: Any, wavelength: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions x and y on the pupil's plane and the wavefront there, the negative of the phase. All in m."""
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
    _check_even(amplitude, x, y, lit)
    rows, columns = np.nonzero(lit)
    return x[columns], y[rows], -_unwrapped(data, illuminated)[lit] * wavelength / (2 * np.pi)


def _check_even(amplitude: np.ndarray, x: np.ndarray, y: np.ndarray, lit: np.ndarray) -> None:
    """Raise a ValueError unless the circle around the illuminated samples is open and evenly illuminated everywhere."""
    rows, columns = np.nonzero(lit)
    (middle_x, middle_y), radius = _circle(x[columns], y[rows])
    within = amplitude[np.hypot(y[:, None] - middle_y, x[None, :] - middle_x) < ROUND * radius]
    middle = np.median(within) if within.size else 0.0
    if within.size and np.abs(within - middle).max() > EVEN * middle:
        raise ValueError("data: the pupil is obscured, not round, or unevenly lit: only open circles can be read")


def _circle(x: np.ndarray, y: np.ndarray) -> tuple[tuple[float, float], float]:
    """Return the centre and the radius of the circle around the points.

    The circle is a least-squares fit to all corners of the convex hull (Kåsa, IEEE Trans. Instrum. Meas. 25, 8, 1976).
    All corners are used, because a single sample can lie on the rim if the grid has an even number of samples.

    Raises:
        ValueError: the hull is not a disk.
    """
    from scipy.spatial import ConvexHull, QhullError

    scale = float(max(np.ptp(x), np.ptp(y))) or 1.0
    try:
        hull = ConvexHull(np.stack([x, y], axis=1) / scale)
    except (QhullError, ValueError):
        raise ValueError(NOT_ROUND) from None
    corners = hull.points[hull.vertices]
    matrix = np.concatenate([2 * corners, np.ones((len(corners), 1))], axis=1)
    middle = np.linalg.lstsq(matrix, np.sum(corners**2, axis=1), rcond=None)[0][:2]
    radius = float(np.linalg.norm(corners - middle, axis=1).max())
    if hull.volume < FULL * np.pi * radius**2:  # Qhull's name for the area of a plane hull
        raise ValueError(NOT_ROUND)
    return (float(middle[0]) * scale, float(middle[1]) * scale), radius * scale


def _unwrapped(data: np.ndarray, lit: np.ndarray) -> np.ndarray:
    """Return the phase [rad], unwrapped first along the brightest column and then along every row."""
    phase, middle = np.where(lit, np.angle(data), 0.0), int(lit.sum(axis=0).argmax())
    phase[:, middle] = np.unwrap(phase[:, middle])
    right, left = np.unwrap(phase[:, middle:], axis=1), np.unwrap(phase[:, middle::-1], axis=1)[:, ::-1]
    return np.concatenate([left[:, :-1], right], axis=1)


def _fitted(x: np.ndarray, y: np.ndarray, ahead: np.ndarray, distance: float, medium_n: float, order: int) -> ExitPupil:
    modes = [(n, m) for n in range(order + 1) for m in range(-n, n + 1, 2)]
    if len(x) < RAYS_PER_MODE * len(modes):
        raise ValueError(f"{len(x)} samples of the wavefront: must be {RAYS_PER_MODE * len(modes)} or more")
    (middle_x, middle_y), radius = _circle(x, y)
    x, y = x - middle_x, y - middle_y
    r = np.hypot(x, y)
    sector = ((np.arctan2(y, x) / (2 * np.pi) % 1) * SECTORS).astype(int) % SECTORS
    farthest = np.array([r[sector == each].max(initial=0.0) for each in range(SECTORS)])
    if farthest.min() < ROUND * radius:
        raise ValueError(NOT_ROUND)
    if np.mean(r < CENTRE * radius) < FILLED * CENTRE**2:
        raise ValueError("the pupil is obscured: only open circles can be read")
    basis = np.stack([mode(n, m, x / radius, y / radius) for n, m in modes], axis=1)
    found = np.linalg.lstsq(basis, ahead, rcond=None)[0]
    residual = float(np.sqrt(np.mean(np.square(ahead - basis @ found))))
    waves = Zernike({key: float(value) / UM for key, value in zip(modes, found, strict=True) if key != (0, 0)})
    rms = float(np.sqrt(sum(value**2 for (n, _), value in zip(modes, found, strict=True) if n > 1)))
    pupil = Pupil(radius, medium_n=medium_n, thin_lens_focal_length=distance, wavefront=waves)
    return ExitPupil(pupil, distance, rms, residual)


def _flat(name: str, values: Any) -> np.ndarray:
    """Convert a NumPy array, or a tensor that can become one, to a flat float64 array."""
    values = full_precision(name, values)
    plain = values.detach().cpu().numpy() if hasattr(values, "detach") else values
    try:
        return np.atleast_1d(np.asarray(plain, dtype=np.float64)).ravel()
    except (TypeError, ValueError):
        raise ValueError(f"{name} = {shown(values)}: must be real numbers") from None


def _one(name: str, value: Any) -> float:
    """Return a number, or the first number of an array, in the other program's unit."""
    found = _flat(name, value)
    if value is None or found.size == 0 or not abs(found[0]) > 0 or not np.isfinite(found[0]):
        raise ValueError(f"{name} = {shown(value)}: must be a finite number that is not 0")
    return float(found[0])


def _point(name: str, given: Any) -> np.ndarray:
    found = np.concatenate([_flat(name, at)[:1] for at in given]) if is_sized(given) and len(given) else np.empty(0)
    if len(found) != 3 or not np.isfinite(found).all():
        raise ValueError(f"{name} = {shown(given)}: must be three finite lengths (x, y, z)")
    return found
