"""Polarised light on its way to a focus, and its field over a window: it can be looked at again."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.elements.beam import Beam
from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.methods.richards_wolf import Light, focal_integrals
from optics.methods.vector_sum import VectorSum
from optics.numerics.autodiff import number
from optics.numerics.grid import Grid
from optics.numerics.precision import precision

__all__ = ["Converging", "VectorFocus"]

DEBYE = 1.5  # choice: test_microvilli.py
PATH_SAMPLES = 513  # choice: along a radius, at which the path is looked at


@dataclass(frozen=True, eq=False)
class Converging:
    """Light behind a pupil. jones: of its parts that do not interfere, (part, 2). stokes: of it all, over the first."""

    beam: Beam
    aplanatic: bool
    jones: np.ndarray
    stokes: tuple[float, float, float, float]

    @property
    def image(self) -> tuple[float, float]:
        """Where (x, y) [m] the ray through the pupil's centre lands (Snell's law)."""
        beam = self.beam
        x, y = (math.tan(angle) for angle in beam.source.angle)
        bent = beam.pupil.index_before(beam.wavelength) / beam.index / math.hypot(1, x, y)
        axial = math.sqrt(max(1 - bent**2 * (x * x + y * y), 1e-6))
        return number(beam.distance) * bent * x / axial, number(beam.distance) * bent * y / axial

    @property
    def sine(self) -> float:
        """Of the steepest ray."""
        radius, z = self.beam.pupil.radius, number(self.beam.distance)
        return radius / z if self.aplanatic else radius / math.hypot(radius, z)

    @property
    def cutoff(self) -> float:
        """Frequency [1/m] beyond which the intensity has none."""
        return 2 * self.sine * self.beam.index / self.beam.wavelength

    def onto(self, window: Grid) -> VectorFocus:
        """Its field there; the window lies about the image, or about the axis if that is where it is."""
        beam, pupil = self.beam, self.beam.pupil
        along_axis = beam.source.angle == (0.0, 0.0) and len(pupil.aperture.rings) == 1
        if along_axis and pupil.rotationally_symmetric(beam.wavelength):
            found = _symmetric(self, window)
        else:
            found = VectorSum(beam, window, self.aplanatic).components()
        parts = np.tensordot(self.jones, found[:6].reshape(2, 3, *window.shape), axes=1)
        intensity, pure = (np.abs(parts) ** 2).sum(axis=0), parts[0] if len(parts) == 1 else None
        scalar = np.abs(found[6]) ** 2
        return VectorFocus(intensity, scalar, window.dx, pure, parts, window.centre, self.stokes, self)

    @property
    def debye_error(self) -> float:
        """Relative error of what falls on a receptor that plane waves make, in place of waves that converge, roughly.

        Over a distance x from the image, amplitudes 1/D and directions differ by x sin θ/z from those at the image.
        Light comes from as far as rays miss it, and a wavelength over sin θ.
        """
        beam, z = self.beam, number(self.beam.distance)
        beside = 0.0
        if not self.aplanatic:
            slopes = beam.pupil.slopes(beam.wavelength, beam.source)
            beside = z * slopes.turning(z, Grid((1, 1), 1e-9, self.image), beam.index)[1] / beam.index
        return DEBYE * (beam.wavelength / beam.index + beside * self.sine) / z


@dataclass(frozen=True, eq=False)
class VectorFocus:
    """intensity: |Ex|², |Ey|², |Ez|² over the pupil's area, (3, y, x) [1/m²]; what a molecule sees whose dipole lies
    along x, y or z. scalar: what scalar theory says, (y, x). field: Ex, Ey, Ez, (3, y, x); None unless the light is
    fully polarised. parts: fields that do not interfere and together are the light, (part, 3, y, x): one, or two.
    centre: (x, y) [m] of the middle sample. polarization: of the light before the pupil, Stokes' parameters over the
    first. towards: by which it can be looked at again; None for a field from elsewhere.
    """

    intensity: np.ndarray
    scalar: np.ndarray
    dx: float
    field: np.ndarray | None
    parts: np.ndarray
    centre: tuple[float, float]
    polarization: tuple[float, float, float, float]
    towards: Converging | None = None

    def __repr__(self) -> str:
        height, width = self.scalar.shape
        return f"<VectorFocus {height} x {width} samples {self.dx:.3g} m apart, scalar error {self.scalar_error:.1e}>"

    @cached_property
    def psf(self) -> np.ndarray:
        """Of all components, (y, x) [1/m²]."""
        total: np.ndarray = self.intensity.sum(axis=0)
        return total

    @property
    def grid(self) -> Grid:
        """Where the samples lie [m]."""
        height, width = self.scalar.shape
        return Grid((height, width), self.dx, self.centre)

    @property
    def scalar_error(self) -> float:
        """Relative L2 error that scalar theory makes over the window."""
        return float(np.linalg.norm(self.scalar - self.psf) / np.linalg.norm(self.psf))


def _symmetric(towards: Converging, window: Grid) -> np.ndarray:
    """See `VectorSum.components`, by Richards and Wolf's integrals."""
    pupil, wavelength, z = towards.beam.pupil, towards.beam.wavelength, number(towards.beam.distance)
    ends, light = _aplanatic(pupil, z) if towards.aplanatic else _flat(pupil, wavelength, z)
    x, y = window.x[None, :], window.y[:, None]
    radii, back = np.unique(np.round(np.hypot(x, y) / window.dx, 9), return_inverse=True)
    wavenumber = 2 * math.pi * pupil.index_behind(wavelength) / wavelength
    found = focal_integrals(radii * window.dx, wavenumber, z, ends, light)
    along, axial, twice, scalar = found[:, back.reshape(window.shape)] / math.sqrt(pupil.area)
    phi = np.arctan2(y, x)
    by_x = along + twice * np.cos(2 * phi), twice * np.sin(2 * phi), -2j * axial * np.cos(phi)
    by_y = twice * np.sin(2 * phi), along - twice * np.cos(2 * phi), -2j * axial * np.sin(phi)
    return np.array([*by_x, *by_y, scalar])


def _flat(pupil: Pupil, wavelength: float, z: float) -> tuple[tuple[float, float], Light]:
    """r = z tan θ; W is what the path through the pupil and on to the axis has more than the axial one."""
    types = precision("float64")
    inner, outer = (share * pupil.radius for share in pupil.aperture.rings[0])
    r = np.linspace(inner, outer, PATH_SAMPLES)

    def waves(r: np.ndarray) -> np.ndarray:
        path = pupil.path(types.Float64(r), types.Float64(0 * r), wavelength, PointSource(), types).numpy()
        found: np.ndarray = (path + pupil.index_behind(wavelength) * r * r / (np.sqrt(r * r + z * z) + z)) / wavelength
        return found

    def passed(r: np.ndarray) -> np.ndarray:
        found: np.ndarray = pupil.amplitude(types.Float64(r / pupil.radius), types.Float64(0 * r), types).numpy()
        return found

    def at(theta: np.ndarray) -> np.ndarray:
        found: np.ndarray = passed(z * np.tan(theta)) * np.exp(2j * np.pi * waves(z * np.tan(theta))) / np.cos(theta)
        return found

    turns = float(np.abs(np.diff(waves(r))).max()) * (PATH_SAMPLES - 1)
    return (math.atan2(inner, z), math.atan2(outer, z)), Light(at, turns)


def _aplanatic(pupil: Pupil, z: float) -> tuple[tuple[float, float], Light]:
    """r = z sin θ, all rays in phase."""
    inner, outer = (share * pupil.radius for share in pupil.aperture.rings[0])
    return (math.asin(inner / z), math.asin(outer / z)), Light(lambda theta: np.sqrt(np.cos(theta)))
