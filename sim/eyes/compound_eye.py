"""Compound eyes: ommatidia with any viewing directions. The ommatidia of an eye may be equal or different."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

import optics
from optics.numerics.arguments import in_range, of_kind, positive, reals, shown, whole
from optics.numerics.read_only import read_only
from optics.ommatidia.acceptance import AcceptanceFunction, acceptance_function
from optics.spectra.receptors import receptors_of
from optics.spectra.spectrum import daylight
from sim.eyes.mounts import Mount, mounts_of
from sim.eyes.viewing_directions import unit_directions

EXAMPLE = "optics.Ommatidium(optics.FacetLens(25e-6, 14e-6), optics.Waveguide(2e-6))"
TOUCHING = 1e-3  # facets may overlap by this fraction of their diameters, because measured directions are rounded
SAME = 1e-6  # directions that differ by less than this angle [rad] are equal


@dataclass(frozen=True, eq=False)
class CompoundEye:
    """A compound eye, used like `optics.Eye` in a task. Each ommatidium is a facet lens in front of a rhabdom.

    Every ommatidium collects light with its acceptance function, which wave optics computes for each band
    (`optics.acceptance_function`). Signals are normalised: if a white surface in full daylight fills the field of an
    ommatidium, the signal is 1. Observations have the axes (memory, ommatidium, channel), unless `rows` is given. If an
    eye has several mounts, the ommatidia of the first mount come first.

    directions: viewing directions in the frame of the mount: unit vectors (ahead, left, up), (n, 3), or (azimuth to the
        left, elevation upwards) in degrees, (n, 2). See `sim.hexagonal_patch` and `sim.whole_head`. The attribute
        always contains unit vectors.
    ommatidium: an `optics.Ommatidium` for all directions, or a sequence with one for each direction. If the same object
        occurs several times, its acceptance function is computed once. Distinct objects are computed separately, even
        if they are equal.
    receptors: receptor types, see `optics.Eye`. Mosaics are not supported here; use `types`.
    types: type of the receptors in each ommatidium, indices into `receptors`, (n, channel). With one column, each
        ommatidium has a single receptor, as in a mosaic. Three columns can describe R1-6, R7 and R8 of a fly, whose R7
        and R8 have different pigments in pale and yellow ommatidia. None: every ommatidium has receptors of all types.
    bands: number of spectral bands, 1 to 64
    noise_sigma: standard deviation of a receptor's Gaussian noise, in the unit of signals, 0 to 1e6
    photon_budget: an `optics.PhotonBudget`. Photons are counted in each ommatidium before its signal is normalised. A
        wide facet therefore has less shot noise than a narrow one with the same field. None: no shot noise
    rows: number of rows, if the directions are those of `sim.hexagonal_rows`. Observations then have the axes of an
        `optics.Eye`, (memory, eye, channel, row, column). None: the directions form no rows
    radius: radius [m] of the eye's surface, a sphere around the mount on which the facets lie. Facets must not overlap.
        None: all facets are at the mount, and may overlap
    spectral_bands: attribute, the bands and the weights of the receptor types in them (`optics.SpectralBands`)

    Raises:
        ValueError: an argument is invalid, there are no ommatidia or more than 1,000,000, their number is no multiple
            of `rows`, two directions are equal, or facets overlap.
    """

    directions: Any
    ommatidium: optics.Ommatidium | Sequence[optics.Ommatidium]
    receptors: Any = "rgb"
    types: Any = None
    bands: int = 4
    noise_sigma: float = 0.01
    photon_budget: optics.PhotonBudget | None = None
    radius: float | None = None
    rows: int | None = None
    spectral_bands: optics.SpectralBands = field(init=False, repr=False)

    def __post_init__(self) -> None:
        def put(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        put("directions", read_only(unit_directions("CompoundEye: directions", self.directions)))
        if not isinstance(self.ommatidium, optics.Ommatidium):
            put("ommatidium", self._one_for_each(self.ommatidium))
        put("receptors", receptors_of(self.receptors))
        if self.receptors.mosaic is not None:
            raise ValueError("CompoundEye: receptors have a mosaic: must have none, set types instead")
        put("types", self._checked_types())
        in_range("noise_sigma", self.noise_sigma, 0, 1e6)
        if self.photon_budget is not None:
            of_kind("photon_budget", self.photon_budget, optics.PhotonBudget, "PhotonBudget(), or None")
        put("spectral_bands", optics.SpectralBands.uniform(self.bands, self.receptors))
        put("bands", len(self.spectral_bands.wavelengths))
        if self.radius is not None:
            positive("radius", self.radius)
        if self.rows is not None and len(self) % whole("CompoundEye: rows", self.rows, 1, len(self)):
            raise ValueError(f"CompoundEye: rows = {self.rows}: must divide the number of ommatidia, {len(self)}")
        self._refuse_overlap()

    def __len__(self) -> int:
        return len(self.directions)

    def __repr__(self) -> str:
        """Return a short description that omits the directions."""
        each = self.ommatidium if isinstance(self.ommatidium, optics.Ommatidium) else self.ommatidium[0]
        facets = f"{len(self)} ommati{'dium' if len(self) == 1 else 'dia'}, {self.fov_deg:.3g}° wide"
        first = "" if each is self.ommatidium else "first "
        return f"<CompoundEye of {facets}, {first}facet {1e6 * each.lens.diameter:.3g} µm, {self.receptors}>"

    def with_mirror_image(self) -> CompoundEye:
        """Return this eye together with its mirror image on the other side of the body.

        The ommatidia of this eye come first, followed by their mirror images in the same order. The attribute `rows` of
        the new eye is None.

        Raises:
            ValueError: an ommatidium overlaps a mirror image, for example if it looks straight ahead.
        """
        both = np.concatenate([self.directions, self.directions * [1, -1, 1]])
        each = self.ommatidium if isinstance(self.ommatidium, optics.Ommatidium) else (*self.ommatidium,) * 2
        types = None if self.types is None else np.concatenate([self.types, self.types])
        return replace(self, directions=both, ommatidium=each, types=types, rows=None)

    def directions_on(self, mounts: Sequence[Mount]) -> np.ndarray:
        """Return the viewing directions of eyes on one or more mounts, unit vectors (ommatidia of all mounts, 3).

        Their components are (ahead, left, up) in the frame of the object that carries the mounts.

        Raises:
            ValueError: `mounts` is empty, or contains anything other than mounts.
        """
        ahead, left, up = self.directions.T
        in_eye = np.stack([-left, up, ahead], axis=-1)
        if not (known := mounts_of("mounts", mounts)):
            raise ValueError("mounts is empty: must be at least one sim.Mount")
        return np.concatenate([in_eye @ mount.local("body")[1].T for mount in known])

    @property
    def resolution(self) -> tuple[int, int]:
        """Number of rows, and number of ommatidia in a row; a single row if `rows` is None."""
        return self.rows or 1, len(self) // (self.rows or 1)

    @property
    def channels(self) -> int:
        """Number of signals of an ommatidium."""
        return len(self.receptors.types) if self.types is None else int(self.types.shape[1])

    @property
    def mosaic(self) -> np.ndarray | None:
        """Receptor type of each signal, (channel, row, column).

        It is None if every ommatidium has receptors of all types, in the order of `receptors`.
        """
        return None if self.types is None else self.types.T.reshape(-1, *self.resolution)

    @property
    def fov_deg(self) -> float:
        """Horizontal field of view [degrees], up to 360: twice the largest azimuth of a direction, left or right."""
        return float(2 * np.degrees(np.abs(np.arctan2(self.directions[:, 1], self.directions[:, 0])).max()))

    @property
    def throughput(self) -> float:
        """Signal of a white surface: 1, because signals are normalised."""
        return 1.0

    aperture_throughput = white_signal = throughput

    @cached_property
    def kinds(self) -> tuple[tuple[optics.Ommatidium, ...], np.ndarray]:
        """The distinct `optics.Ommatidium` objects of the eye, and for each direction the index of its object, (n,)."""
        if isinstance(self.ommatidium, optics.Ommatidium):
            return (self.ommatidium,), np.zeros(len(self), int)
        numbers: dict[optics.Ommatidium, int] = {}
        index = [numbers.setdefault(one, len(numbers)) for one in self.ommatidium]
        return tuple(numbers), np.array(index)

    def acceptance(self, kind: int) -> AcceptanceFunction:
        """Return the acceptance function of the ommatidium with this index in `kinds`, for the eye's bands.

        The properties `solid_angles`, `white` and `photons` raise the same errors.

        Raises:
            ValueError: there is no ommatidium with this index, or the rhabdom guides no light in a band.
            optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
        """
        different = self.kinds[0]
        return acceptance_function(
            different[whole("kind", kind, 0, len(different) - 1)], self.spectral_bands.wavelengths
        )

    @cached_property
    def solid_angles(self) -> np.ndarray:
        """Integral of each ommatidium's acceptance function [sr], (ommatidium, band)."""
        kinds, index = self.kinds
        found: np.ndarray = np.stack([self.acceptance(k).integrals for k in range(len(kinds))])[index]
        return found

    @property
    def white(self) -> np.ndarray:
        """Acceptance of white light by each receptor type [sr], (type, ommatidium).

        It is Σ_b weights[type, b] daylight_b Ω_b. Ω_b is the integral of an ommatidium's acceptance function in band b,
        see `solid_angles`.
        """
        bands = self.spectral_bands
        found: np.ndarray = (bands.weights * daylight(bands.wavelengths)) @ self.solid_angles.T
        return found

    @property
    def photons(self) -> np.ndarray | None:
        """Photons that a receptor absorbs in its integration time if its signal is 1, (channel, ommatidium).

        It is None without a photon budget. The number is proportional to the étendue: the facet's area times the
        integral of the acceptance function for white light, see `white`.
        """
        if self.photon_budget is None:
            return None
        kinds, index = self.kinds
        area = np.array([kind.pupil.area for kind in kinds])[index]
        per_etendue = self.photon_budget.photons(self.spectral_bands, 1.0)
        found: np.ndarray = per_etendue[:, None] * area * self.white
        return found if self.types is None else np.take_along_axis(found, self.types.T, axis=0)

    @property
    def receptor_photons(self) -> np.ndarray | None:
        """`photons` in the shape of signals, (channel, row, column); None without a photon budget."""
        return None if self.photons is None else self.photons.reshape(-1, *self.resolution)

    def as_frames(self, signals: np.ndarray) -> np.ndarray:
        """Return signals (..., eye, channel, row, column) in the form (..., ommatidia of all eyes, channel)."""
        frames = np.swapaxes(signals.reshape(*signals.shape[:-2], -1), -1, -2)
        return np.ascontiguousarray(frames.reshape(*frames.shape[:-3], -1, frames.shape[-1]))

    def _one_for_each(self, given: Any) -> tuple[optics.Ommatidium, ...]:
        where = "CompoundEye: ommatidium"
        if not isinstance(given, Sequence) or len(given) != len(self):
            raise ValueError(
                f"{where} = {shown(given)}: must be an Ommatidium, or one for each of {len(self)} directions"
            )
        for number, one in enumerate(given):
            of_kind(f"{where}[{number}]", one, optics.Ommatidium, EXAMPLE)
        return tuple(given)

    def _checked_types(self) -> np.ndarray | None:
        if self.types is None:
            return None
        given, count = reals("CompoundEye: types", self.types), len(self.receptors.types)
        fits = given.ndim == 2 and len(given) == len(self) and given.shape[1] >= 1
        if not fits or not np.isin(given, np.arange(count)).all():
            what = f"({len(self)}, channel) of indices from 0 to {count - 1}"
            raise ValueError(f"CompoundEye: types has shape {given.shape}: must be an array {what}")
        return read_only(given.astype(int))

    def _refuse_overlap(self) -> None:
        """Raise a ValueError if two directions are equal or two facets overlap.

        Facets can overlap only if `radius` is given. They do if they are closer than the mean of their diameters.
        """
        from scipy.spatial import KDTree

        if len(self) == 1:
            return
        sizes = np.full(len(self), SAME)
        if self.radius is not None:
            # Diameter across flats of a hexagon with the facet's area, as an angle.
            kinds, index = self.kinds
            diameters = np.array([(2 * kind.pupil.area / 3**0.5) ** 0.5 for kind in kinds])[index]
            sizes = np.maximum(sizes, (1 - TOUCHING) * diameters / self.radius)
        tree = KDTree(self.directions)
        # Nearest neighbours are tested first. If the radius is far too small, they overlap, and the list of all
        # overlapping pairs would not fit into memory.
        neighbours = tree.query(self.directions, k=[2])[1][:, 0]
        self._refuse_pairs(np.stack([np.arange(len(self)), neighbours], axis=-1), sizes)
        self._refuse_pairs(tree.query_pairs(float(sizes.max()), output_type="ndarray"), sizes)

    def _refuse_pairs(self, pairs: np.ndarray, sizes: np.ndarray) -> None:
        """Raise a ValueError if the two facets of a pair are closer than the mean of their sizes.

        pairs: indices of two facets each, (pair, 2)
        sizes: sizes of all facets [rad], (ommatidium,)
        """
        pairs = pairs[pairs[:, 0] != pairs[:, 1]]
        chords = np.linalg.norm(self.directions[pairs[:, 0]] - self.directions[pairs[:, 1]], axis=1)
        close = np.flatnonzero(chords < sizes[pairs].mean(axis=1))
        if not close.size:
            return
        (one, other), chord, gap = np.sort(pairs[close[0]]), chords[close[0]], "in the same direction"
        if self.radius is not None:
            gap = f"{chord * self.radius:.3g} m apart, less than their diameter, for radius = {self.radius:g}"
        raise ValueError(f"CompoundEye: facets {one} and {other} overlap: they are {gap}")


WorldEye: TypeAlias = optics.Eye | CompoundEye  # eyes that can be rendered in worlds


def world_eye(name: str, value: Any) -> WorldEye:
    """Return `value` if it is an eye for which worlds can be rendered.

    Raises:
        ValueError: it is neither an optics.Eye nor a CompoundEye; the message begins with `name`.
    """
    if isinstance(value, CompoundEye):
        return value
    eye: optics.Eye = of_kind(name, value, optics.Eye, "optics.Eye(resolution=(15, 15)), or a sim.CompoundEye")
    return eye
