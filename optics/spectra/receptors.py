"""Receptor types: spectral sensitivities, and the arrangement of types over a retina."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from optics.numerics.arguments import is_sized, one_of, reals, shown, without_derivative
from optics.numerics.number_types import readable
from optics.spectra.pigment import Pigment
from optics.spectra.spectrum import LIMITS_NM, Spectrum, cone_fundamentals, daylight

__all__ = ["RECEPTORS", "Receptors", "receptors_of"]

# Light neglected beyond either end of the range of wavelengths, as a fraction of each type's catch from a white surface
# in daylight.
NEGLIGIBLE = 1e-3
STEP_NM = 10  # ends of the range are multiples of this step


@dataclass(frozen=True)
class Receptors:
    """The receptor types of an eye, and their arrangement over the retina.

    types: one entry per type: a `Pigment`; a number, which is the λmax [nm] of an A1 pigment; or a `Spectrum`, which is
        a measured quantal sensitivity. Channels have the order of the types.
    mosaic: None, or rows of indices into `types` such as ((0, 1), (1, 2)). None: every position of the retina has
        receptors of all types, like the pixels of a camera, and signals are (type, h, w). Rows: every receptor has one
        type, as in a real retina, and signals are (1, h, w). The rows are repeated over the retina from its top left
        corner.
    range_nm: range of wavelengths (low, high) [nm] that is divided into bands: whole numbers within 300-780. None: the
        range is chosen so that each type absorbs at most 1e-3 of its photons from a white surface in daylight below the
        range, and at most 1e-3 above it.

    Raises:
        ValueError: an argument is invalid; the message states the valid choices.
    """

    types: tuple[Any, ...]
    mosaic: tuple[tuple[int, ...], ...] | None = None
    range_nm: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "types", _types(self.types))
        if self.mosaic is not None:
            object.__setattr__(self, "mosaic", _mosaic(self.mosaic, len(self.types)))
        if self.range_nm is not None:
            object.__setattr__(self, "range_nm", _range(self.range_nm))
            seen = self.catch(np.arange(self.range_nm[0], self.range_nm[1] + 1)).max(axis=1) > 0
            if not seen.all():
                dark = int(np.argmin(seen))
                raise ValueError(f"range_nm = {shown(self.range_nm)}: type {dark} has no sensitivity within it")

    def __repr__(self) -> str:
        """Return a short description with the peak of each type."""
        peaks = ", ".join(
            f"{kind.peak_nm if isinstance(kind, Spectrum) else kind.lambda_max_nm:g}" for kind in self.types
        )
        mosaic = "" if self.mosaic is None else f", mosaic of {len(self.mosaic)} x {len(self.mosaic[0])}"
        return f"<Receptors with peaks at {peaks} nm{mosaic}>"

    @cached_property
    def limits_nm(self) -> tuple[float, float]:
        """Range of wavelengths [nm] that is divided into bands."""
        return _range_of(self) if self.range_nm is None else self.range_nm

    @property
    def channels(self) -> int:
        """Number of signals at each position of the retina."""
        return len(self.types) if self.mosaic is None else 1

    def arranged(self, mosaic: Sequence[Sequence[int]] | np.ndarray | None) -> Receptors:
        """Return the same types arranged in this mosaic.

        Raises:
            ValueError: see `Receptors`.
        """
        return replace(self, mosaic=None if mosaic is None else _mosaic(mosaic, len(self.types)))

    def layout(self, resolution: tuple[int, int]) -> np.ndarray | None:
        """Return the type of every receptor, (h, w) int, for a resolution (h, w); None without a mosaic."""
        readable("resolution", resolution)
        if self.mosaic is None:
            return None
        tile = np.array(self.mosaic)
        return tile[np.ix_(*(np.arange(n) % m for n, m in zip(resolution, tile.shape, strict=True)))]

    def catch(self, nm: np.ndarray) -> np.ndarray:
        """Return each type's catch of daylight at wavelengths [nm], (type, wavelength), up to a common factor.

        The catch is daylight times λ times the quantal sensitivity, whose peak is 1. The factor λ is necessary because
        receptors count photons, while radiance is energy.

        Raises:
            ValueError: a wavelength is invalid.
        """
        nm = reals("nm", nm)
        light = daylight(nm * 1e-9)
        peaks = [max(kind.values) if isinstance(kind, Spectrum) else 1.0 for kind in self.types]
        return np.stack([kind.at(nm * 1e-9) / peak * nm * light for kind, peak in zip(self.types, peaks, strict=True)])


def _types(types: Any) -> tuple[Pigment | Spectrum, ...]:
    without_derivative("receptors", types)
    if isinstance(types, str) or not is_sized(types):
        types = (types,)
    if not len(types):
        raise ValueError("receptors: no type is given; an eye needs at least one")
    found = tuple(kind if isinstance(kind, (Pigment, Spectrum)) else _pigment(kind) for kind in types)
    for i, kind in enumerate(found):
        if not kind.at(np.arange(*LIMITS_NM) * 1e-9).max() > 0:
            raise ValueError(f"receptors: type {i} has no sensitivity between {LIMITS_NM[0]:g} and {LIMITS_NM[1]:g} nm")
    return found


def _pigment(lambda_max_nm: Any) -> Pigment:
    try:
        return Pigment(float(lambda_max_nm))
    except (TypeError, ValueError, OverflowError):
        raise ValueError(
            f"receptors hold {shown(lambda_max_nm)}: must be wavelengths of peaks in [330, 700] nm, Pigments or Spectra"
        ) from None


def _mosaic(mosaic: Any, types: int) -> tuple[tuple[int, ...], ...]:
    try:
        tile = np.array(readable("mosaic", mosaic))
        whole = tile.ndim == 2 and tile.size > 0 and bool(np.all(tile == tile.astype(int)))
    except (TypeError, ValueError, OverflowError):
        whole = False
    if not whole or tile.min() < 0 or tile.max() >= types:
        raise ValueError(f"mosaic: must be rows, equally long, of indices of types from 0 to {types - 1}")
    return tuple(tuple(int(kind) for kind in row) for row in tile)


def _range(range_nm: Any) -> tuple[float, float]:
    try:
        low, high = (float(end) for end in range_nm)
        fits = LIMITS_NM[0] <= low < high <= LIMITS_NM[1] and low == int(low) and high == int(high)
    except (TypeError, ValueError, OverflowError):
        fits = False
    if not fits:
        raise ValueError(f"range_nm = {shown(range_nm)}: must be (low, high), whole numbers [nm] within 300-780")
    return low, high


def _range_of(receptors: Receptors) -> tuple[float, float]:
    """Return the range (low, high) [nm] outside which every receptor type absorbs a negligible part of daylight.

    For each receptor type, consider all photons that it absorbs from a white surface in daylight. At most the fraction
    NEGLIGIBLE of them lies below the range, and at most this fraction above it.
    """
    nm = np.arange(LIMITS_NM[0], LIMITS_NM[1] + 1)
    so_far = np.cumsum(receptors.catch(nm), axis=1)
    so_far /= so_far[:, -1:]
    first = nm[np.argmax((so_far > NEGLIGIBLE).any(axis=0))]
    last = nm[np.argmax((so_far >= 1 - NEGLIGIBLE).all(axis=0))]
    return float(first // STEP_NM * STEP_NM), float(-(-last // STEP_NM) * STEP_NM)


# Peaks of red, green and blue receptors, as in swallowtail butterflies (Arikawa 2003, J. Comp. Physiol. A 189:791).
# They are far enough apart to separate colours like three RGB channels, unlike those of human cones (566, 541, 441 nm).
_RGB_NM = (600.0, 520.0, 460.0)

RECEPTORS: Mapping[str, Callable[[], Receptors]] = {
    "rgb": lambda: Receptors(_RGB_NM, range_nm=(400.0, 700.0)),
    "lms": lambda: Receptors(cone_fundamentals()),
    # Worker bees' green, blue and UV receptors: Peitsch et al. (1992), J. Comp. Physiol. A 170:23.
    "honeybee": lambda: Receptors((544.0, 436.0, 344.0)),
    # Cones: Palacios et al. (1998), Vision Research 38:2135.
    "goldfish": lambda: Receptors(tuple(Pigment(peak, "A2") for peak in (623.0, 537.0, 447.0, 356.0))),
    # R1-6, R7 and R8 in pale ommatidia, R7 and R8 in yellow ommatidia. The ultraviolet peak of R1-6 is omitted.
    # Drosophila: Salcedo et al. (1999), J. Neurosci. 19:10716.
    "fruit_fly": lambda: Receptors((478.0, 345.0, 437.0, 375.0, 508.0)),
    # Musca: Hardie (1985), Progr. Sensory Physiol. 5:1.
    "blowfly": lambda: Receptors((490.0, 335.0, 460.0, 430.0, 520.0)),
    # Sympetrum, ventral eye: Meinertzhagen, Menzel & Kahle (1983), J. Comp. Physiol. A 151:295.
    "dragonfly": lambda: Receptors((620.0, 515.0, 410.0, 340.0)),
    # Principal eyes of Plexippus: Blest, Hardie, McIntyre & Williams (1981), J. Comp. Physiol. A 145:227.
    "jumping_spider": lambda: Receptors((520.0, 360.0)),
    # Cones: Abballe & Asari (2022), PLoS ONE 17:e0262763.
    "mouse": lambda: Receptors((508.0, 360.0)),
}


def receptors_of(receptors: Any) -> Receptors:
    """Convert an argument to `Receptors`.

    receptors: `Receptors`, a name such as "rgb" or "lms" (the keys of RECEPTORS), or a sequence of receptor types.

    Raises:
        ValueError: a name is unknown (the message suggests a similar one, if any), the sequence is empty, or a type is
            invalid.
    """
    if isinstance(receptors, Receptors):
        return receptors
    if isinstance(receptors, str):
        return RECEPTORS[one_of("receptors", receptors, RECEPTORS)]()
    if receptors is None:
        raise ValueError("receptors = None: must be a name, wavelengths of peaks [nm], or Receptors")
    return Receptors(receptors)
