"""The eyes of the built-in agent: their number, their positions on its body, and their optics.

The body is a sphere that stands on the floor. The eyes sit on its equator and look outwards. Azimuths are measured in
the agent's frame (x forward, y left, z up), positive to the left.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from optics.numerics.arguments import flag, shown
from optics.numerics.number_types import is_boolean
from optics.numerics.renamed import warn_renamed
from optics.spectra.bands import FINEST
from optics.spectra.photon_budget import PhotonBudget
from optics.spectra.receptor_dynamics import ReceptorDynamics
from optics.spectra.receptors import receptors_of
from sim.eyes.hexagonal_rows import ROW_DISTANCE, SHARPEST, hexagonal_rows, lattice_fovy_deg

if TYPE_CHECKING:
    from optics import Ommatidium, Pupil, Waveguide
    from sim.eyes.compound_eye import WorldEye

BODY_RADIUS = 0.2  # [m]
MOST = 10**6  # chosen limit for all counts; larger numbers would exceed any computer's memory
EYE_HEIGHT = BODY_RADIUS  # [m] above the floor: the equator of a sphere that stands on it


@dataclass(frozen=True)
class Eyes:
    """The eyes of one agent, which differ only in azimuth.

    n_eyes: number of eyes, 1 to 1,000,000
    resolution: receptors of one eye (height, width), each 1 to 1,000,000 (for compound eyes 1 to 1000)
    fov_deg: horizontal field of view of one eye [deg], in [0.001, 170]
    placement_range_deg: angle from the leftmost to the rightmost eye [deg], in [0, 360]; at 360 these two eyes look in
        the same direction
    optics: optics.Pupil of every eye; None: a perfect lens
    sensor_width: width of the retina [m]
    noise_sigma: standard deviation of a receptor's noise; the unit is the signal of a receptor that sees a white
        surface in full daylight through a perfect lens
    bands: number of spectral bands, 1 to 64
    receptors: receptor types. A name: "rgb" (three channels), "lms" (human cones), "honeybee", "goldfish", "mouse",
        "fruit_fly", "blowfly", "dragonfly" or "jumping_spider"; or peak wavelengths of visual pigments [nm], such as
        (350, 440, 530); or an `optics.Receptors`, which can also describe a mosaic. The attribute is always converted
        to optics.Receptors.
    photon_budget: an optics.PhotonBudget, which defines the amount of light and the integration time of the receptors.
        The resulting shot noise is added to the noise of `noise_sigma`. None: unlimited light, without shot noise.
    waveguide: an optics.Waveguide: receptors are rhabdoms, which receive light in waveguide modes; the eyes then need
        a pupil (`optics`). None: each receptor receives all light that falls on its area.
    pupil_turned: True if the pupils are rotated by 180° about their axes
    vertical_fov_deg: vertical field of view of one eye [deg], in [0.001, 170]. None: receptors are square
    dynamics: an optics.ReceptorDynamics: receptors that integrate, adapt or detect motion over time. None: no memory
    density: density of receptors over the retina, such as `optics.Fovea()`, see `optics.Eye`. None: it is uniform
    ommatidium: an optics.Ommatidium: the eyes are compound eyes. The ommatidia form the lattice of
        `sim.hexagonal_rows`. `resolution` is then (rows of the lattice, ommatidia in each row). `fov_deg` divided by
        the number of ommatidia in a row is the mean difference in azimuth between neighbours in a row. Compound eyes
        have neither optics, waveguide, vertical_fov_deg, dynamics nor density, and ignore sensor_width. None: the eyes
        are camera eyes.
    acute_zone: density of ommatidia in the middle of a compound eye, relative to the mean, 1 to 5; 1 for camera
        eyes; see `sim.hexagonal_rows`

    Raises:
        ValueError: a value is invalid or does not fit the others, such as a waveguide that is wider than a receptor.
    """

    n_eyes: int = 2
    resolution: tuple[int, int] = (15, 15)
    fov_deg: float = 45.0
    placement_range_deg: float = 60.0
    optics: Pupil | None = None
    sensor_width: float = 200e-6
    noise_sigma: float = 0.01
    bands: int = 4
    receptors: Any = "rgb"
    photon_budget: PhotonBudget | None = None
    waveguide: Waveguide | None = None
    pupil_turned: bool = False
    vertical_fov_deg: float | None = None
    dynamics: ReceptorDynamics | None = None
    density: Any = None
    ommatidium: Ommatidium | None = None
    acute_zone: float = 1.0

    def __post_init__(self) -> None:
        def check(name: str, valid: Callable[[Any], bool], range_: str) -> None:
            value = getattr(self, name)
            try:
                fits = not is_boolean(value) and bool(valid(value))
            except (TypeError, ValueError, OverflowError):
                fits = False
            if not fits:
                raise ValueError(f"Eyes: {name} = {shown(value)}: must be {range_}")

        def counts(value: Any) -> bool:
            return not is_boolean(value) and 1 <= value == int(value) <= MOST

        check("n_eyes", counts, f"a whole number, at least 1 and at most {MOST}")
        check(
            "resolution",
            lambda r: len(r) == 2 and all(map(counts, r)),
            f"(height, width), whole numbers, each at least 1 and at most {MOST}",
        )
        check("fov_deg", lambda x: 1e-3 <= x <= 170.0, "in [0.001, 170]")
        check("vertical_fov_deg", lambda x: x is None or 1e-3 <= x <= 170.0, "in [0.001, 170], or None")
        check("placement_range_deg", lambda x: 0.0 <= x <= 360.0, "in [0, 360]")
        check("sensor_width", lambda x: 0.0 < x < math.inf, "positive and finite")
        check("noise_sigma", lambda x: 0.0 <= x < math.inf, "non-negative and finite")
        check("bands", lambda x: counts(x) and x <= FINEST, f"a whole number, at least 1 and at most {FINEST}")
        for name in ("n_eyes", "bands"):
            object.__setattr__(self, name, int(getattr(self, name)))
        object.__setattr__(self, "resolution", tuple(map(int, self.resolution)))
        object.__setattr__(self, "receptors", receptors_of(self.receptors))
        check("optics", _is_pupil, "an optics.Pupil or None, the perfect lens")
        check("photon_budget", lambda x: isinstance(x, PhotonBudget | None), "an optics.PhotonBudget or None")
        check("dynamics", lambda x: isinstance(x, ReceptorDynamics | None), "an optics.ReceptorDynamics or None")
        self._check_density()
        flag("Eyes: pupil_turned", self.pupil_turned)
        if self.pupil_turned and self.optics is None:
            raise ValueError(
                "Eyes: pupil_turned = True and optics = None: must be False, or a Pupil that can be turned"
            )
        if self.waveguide is not None:
            self._check_waveguide()
        check("acute_zone", lambda x: 1 <= x <= SHARPEST, f"in [1, {SHARPEST:g}]")
        if self.acute_zone != 1 and self.ommatidium is None:
            raise ValueError(f"Eyes: acute_zone = {shown(self.acute_zone)}: must be 1, the eyes have no ommatidia")
        if self.ommatidium is not None:
            self._refuse_parts_of_camera_eyes()
            self.eye()

    def _refuse_parts_of_camera_eyes(self) -> None:
        for name in ("optics", "waveguide", "vertical_fov_deg", "dynamics", "density"):
            if getattr(self, name) is not None:
                value = shown(getattr(self, name))
                raise ValueError(f"Eyes: {name} = {value}: must be None for compound eyes, which have an ommatidium")

    def eye(self) -> WorldEye:
        """Return one eye: an `optics.Eye`, or a `sim.CompoundEye`.

        Raises:
            ValueError: `noise_sigma` is above 1e6, or `sensor_width` is outside [1e-15, 1e15] m.
        """
        from optics import Eye

        if self.ommatidium is not None:
            from sim.eyes.compound_eye import CompoundEye

            return CompoundEye(
                hexagonal_rows(*self.resolution, self.fov_deg, self.acute_zone),
                self.ommatidium,
                receptors=self.receptors,
                bands=self.bands,
                noise_sigma=self.noise_sigma,
                photon_budget=self.photon_budget,
                rows=self.resolution[0],
            )
        return Eye(
            pupil=self.optics,
            resolution=self.resolution,
            fov_deg=self.fov_deg,
            sensor_width=self.sensor_width,
            bands=self.bands,
            noise_sigma=self.noise_sigma,
            receptors=self.receptors,
            photon_budget=self.photon_budget,
            waveguide=self.waveguide,
            pupil_turned=self.pupil_turned,
            vertical_fov_deg=self.vertical_fov_deg,
            dynamics=self.dynamics,
            density=self.density,
        )

    def with_perfect_lens(self) -> Eyes:
        """Return camera eyes with a perfect lens, and with the receptors and fields of view of these eyes.

        Raises:
            ValueError: the vertical field of view is above 170 degrees.
        """
        vertical = self.vertical_fov_deg if self.ommatidium is None else self.fovy_deg
        camera = replace(self, ommatidium=None, acute_zone=1.0, vertical_fov_deg=vertical)
        return replace(camera, optics=None, waveguide=None, pupil_turned=False)

    def _check_waveguide(self) -> None:
        from optics.eye.geometry import receptor_size
        from optics.eye.guided_field import check_guide

        try:
            check_guide(
                self.waveguide,
                self.optics,
                receptor_size(self.resolution, self.sensor_width, self.fov_deg, self.vertical_fov_deg),
            )
        except ValueError as error:
            raise ValueError(f"Eyes: {error}") from None

    def _check_density(self) -> None:
        if self.density is None:
            return
        from optics.eye.receptor_density import density_of

        try:
            object.__setattr__(self, "density", density_of(self.density))
        except ValueError as error:
            raise ValueError(f"Eyes: {error}") from None

    def azimuths(self) -> np.ndarray:
        """Return the azimuth of each optical axis [rad], (n_eyes,), from left (+) to right (-).

        Axes are spaced evenly: three eyes over a range of 90° look to 45°, 0° and -45°. A single eye looks ahead.
        """
        if self.n_eyes == 1:
            return np.zeros(1)
        half = math.radians(self.placement_range_deg) / 2
        return np.linspace(half, -half, self.n_eyes)

    def column_azimuths(self) -> np.ndarray:
        """Return the azimuth of each column of receptors relative to the eye's axis [rad], (width,), left is positive.

        The result ignores `density` and, in a compound eye, the shift of its rows by a quarter of the columns' spacing.
        """
        columns = self.resolution[1]
        if self.ommatidium is not None:
            ahead, left, _ = hexagonal_rows(1, columns, self.fov_deg, self.acute_zone).T
            return np.arctan2(left, ahead)
        across = np.tan(np.radians(self.fov_deg) / 2)
        return -np.arctan((2 * np.arange(columns) + 1 - columns) / columns * across)

    def names(self) -> tuple[str, ...]:
        """Return the names of the eyes from left to right.

        One eye is "center", two are "left" and "right", and three are "left", "center" and "right". More eyes are
        numbered: "eye_0", "eye_1" and so on. Files, reports, cameras and recordings use these names.
        """
        special = {1: ("center",), 2: ("left", "right"), 3: ("left", "center", "right")}
        return special.get(self.n_eyes, tuple(f"eye_{i}" for i in range(self.n_eyes)))

    @property
    def fovy_deg(self) -> float:
        """Vertical field of view of one eye [deg], derived from the horizontal one if `vertical_fov_deg` is None."""
        if self.ommatidium is not None:
            return lattice_fovy_deg(*self.resolution, self.fov_deg)
        if self.vertical_fov_deg is not None:
            return self.vertical_fov_deg
        height, width = self.resolution
        return math.degrees(2 * math.atan(math.tan(math.radians(self.fov_deg) / 2) * height / width))

    @property
    def field_aspect(self) -> float:
        """Width of an eye's field of view divided by its height, on a plane in front of the eye.

        For compound eyes, it is the width of the lattice divided by its height in Mercator's projection.
        """
        if self.ommatidium is not None:
            return self.resolution[1] / (self.resolution[0] * ROW_DISTANCE)
        if self.vertical_fov_deg is None:
            return self.resolution[1] / self.resolution[0]
        return math.tan(math.radians(self.fov_deg) / 2) / math.tan(math.radians(self.vertical_fov_deg) / 2)

    def fov_vertical_deg(self) -> float:
        """Return `fovy_deg`. Deprecated."""
        warn_renamed("Eyes.fov_vertical_deg()", "Eyes.fovy_deg")
        return self.fovy_deg


def _is_pupil(value: Any) -> bool:
    """Return True if the value is a Pupil or None."""
    if value is None:
        return True
    from optics import Pupil

    return isinstance(value, Pupil)


def eye_positions(azimuths: np.ndarray) -> np.ndarray:
    """Return centres (n, 3) [m] of pupils on the body's equator at azimuths (n,) [rad], in the agent's frame."""
    return BODY_RADIUS * np.stack([np.cos(azimuths), np.sin(azimuths), np.zeros_like(azimuths)], axis=-1)


def eye_rotations(azimuths: np.ndarray) -> np.ndarray:
    """Return the frames (n, 3, 3) of eyes at azimuths [rad], (n,), in the agent's frame.

    Columns: x to the right, y up, z outwards along the optical axis (docs/architecture.md, "Coordinates").
    """
    cos, sin, zero, one = np.cos(azimuths), np.sin(azimuths), np.zeros_like(azimuths), np.ones_like(azimuths)
    right = np.stack([sin, -cos, zero], axis=-1)
    up = np.stack([zero, zero, one], axis=-1)
    axis = np.stack([cos, sin, zero], axis=-1)
    return np.stack([right, up, axis], axis=-1)


def camera_rotations(azimuths: np.ndarray) -> np.ndarray:
    """Return the frames of `eye_rotations` in MuJoCo's convention for cameras: x to the right, y up, view along -z."""
    return eye_rotations(azimuths) * np.array([1.0, 1.0, -1.0])
