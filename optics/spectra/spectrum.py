"""Spectra as tables: illuminants, reflectances, cone fundamentals, and user data.

The tables of water and phytoplankton are copied from publications. All others are copied from the package
colour-science, and tests compare them with the package. The original sources are named with each table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources

import numpy as np

from optics.numerics.arguments import one_of, reals, vacuum_wavelengths, without_derivative
from optics.numerics.number_types import full_precision

__all__ = [
    "ILLUMINANTS",
    "LIMITS_NM",
    "REFLECTANCES",
    "Spectrum",
    "cie_1931",
    "cone_fundamentals",
    "daylight",
    "illuminant",
    "phytoplankton_absorption",
    "reflectance",
    "srgb_basis",
    "water_absorption",
]

LIMITS_NM = (300.0, 780.0)  # the table of CIE D65 starts at 300 nm; no receptors absorb beyond 780 nm
SHORTEST_NM = 1.0  # [nm] shortest wavelength in a table; smaller numbers are probably in metres
NORMAL_NM = 560.0  # wavelength at which illuminants are 1


@dataclass(frozen=True)
class Spectrum:
    """A quantity as a function of wavelength, given by a table.

    It is linear between the table's entries and constant beyond the ends (as CIE 15 advises).

    wavelengths_nm: wavelengths [nm] in ascending order.
    values: one value per wavelength, finite and not negative.

    Two spectra are equal if their tables are equal.

    Raises:
        ValueError: an argument is invalid; the message states the valid choices.
    """

    wavelengths_nm: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        nm, values = (_row(name, getattr(self, name)) for name in ("wavelengths_nm", "values"))
        if len(nm) != len(values):
            raise ValueError(f"values: {len(values)} for {len(nm)} wavelengths_nm: must be equal in number")
        if not np.all(np.diff(nm) > 0) or not nm[0] >= SHORTEST_NM:
            raise ValueError(f"wavelengths_nm: must rise from one entry to the next, from {SHORTEST_NM:g} nm on")
        if min(values) < 0:
            raise ValueError(f"values hold {min(values):g}: must not be negative")
        object.__setattr__(self, "wavelengths_nm", nm)
        object.__setattr__(self, "values", values)

    def __repr__(self) -> str:
        """Return a short description that omits the table."""
        low, high = self.wavelengths_nm[0], self.wavelengths_nm[-1]
        return f"<Spectrum of {len(self.values)} values from {low:g} to {high:g} nm, peak at {self.peak_nm:g} nm>"

    @property
    def peak_nm(self) -> float:
        """Wavelength of the largest value [nm]; the shortest one if this value occurs several times."""
        return self.wavelengths_nm[int(np.argmax(self.values))]

    def at(self, wavelengths: np.ndarray) -> np.ndarray:
        """Return the values at `wavelengths` [m], an array of any shape.

        Raises:
            ValueError: a wavelength is not positive, or is above 1 m.
        """
        return np.interp(vacuum_wavelengths(wavelengths) * 1e9, self.wavelengths_nm, self.values)


def _row(name: str, numbers: Sequence[float]) -> tuple[float, ...]:
    numbers = full_precision(name, without_derivative(name, numbers))
    try:
        row = np.asarray(numbers, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        row = np.empty(0)
    if row.ndim != 1 or not row.size or not np.isfinite(row).all():
        raise ValueError(f"{name}: must be a row of finite numbers, at least one")
    return tuple(row.tolist())


def _spectrum(nm: np.ndarray, values: np.ndarray) -> Spectrum:
    return Spectrum(tuple(nm.tolist()), tuple(values.tolist()))


@lru_cache(maxsize=6)
def _table(name: str) -> tuple[tuple[str, ...], np.ndarray]:
    """Return the names of all columns except the first in a CSV file, and the values of all columns, (column, row).

    The first column contains wavelengths [nm].
    """
    with resources.files("optics.spectra").joinpath("data", name).open() as file:
        names = tuple(file.readline().strip().split(","))
        return names[1:], np.loadtxt(file, delimiter=",").T


def _columns(name: str) -> dict[str, np.ndarray]:
    names, columns = _table(name)
    return dict(zip(names, columns[1:], strict=True))


def daylight(wavelengths: np.ndarray) -> np.ndarray:
    """Return the relative spectral power of CIE D65, which is 1 at 560 nm and linear between entries 5 nm apart.

    Raises:
        ValueError: a wavelength [m] is outside 300-780 nm.
    """
    nm, d65 = _table("colour_tables.csv")[1][:2]
    return np.interp(_nanometres(wavelengths), nm, d65 / np.interp(NORMAL_NM, nm, d65))


def cie_1931(wavelengths: np.ndarray) -> np.ndarray:
    """Return the CIE 1931 2° colour matching functions x̄, ȳ, z̄, (wavelength, 3).

    wavelengths: wavelengths [m] in 300-780 nm. The functions are 0 up to 355 nm.

    Raises:
        ValueError: a wavelength is outside its range.
    """
    table = _table("colour_tables.csv")[1]
    nm = _nanometres(wavelengths)
    return np.stack([np.interp(nm, table[0], column) for column in table[2:]], axis=-1)


def _nanometres(wavelengths: np.ndarray) -> np.ndarray:
    nm = reals("wavelengths", wavelengths) * 1e9
    low, high = LIMITS_NM
    outside = nm[~((nm > low - 1e-6) & (nm < high + 1e-6))]
    if outside.size:
        raise ValueError(f"wavelengths hold {outside[0] * 1e-9:g} m: must lie in [{low:g}e-9, {high:g}e-9]")
    return nm


# Source: CIE 15. A is incandescent light, D are phases of daylight, E is equal energy, FL are fluorescent lamps, and
# LED-B3 is a phosphor-converted white LED. The tables of the lamps and the LED start at 380 nm; below, they are dark.
ILLUMINANTS = ("A", "D50", "D55", "D65", "D75", "E", "FL2", "FL11", "LED-B3")


def illuminant(name: str) -> Spectrum:
    """Return the relative spectral power of a CIE illuminant on 300-780 nm. It is 1 at 560 nm.

    name: "A", "D50", "D55", "D65", "D75", "E", "FL2", "FL11" or "LED-B3". The last three are 0 up to 375 nm.

    Raises:
        ValueError: the name is unknown.
    """
    one_of("illuminant", name, ILLUMINANTS)
    if name == "E":
        return Spectrum(LIMITS_NM, (1.0, 1.0))
    if name == "D65":
        nm = _table("colour_tables.csv")[1][0]
        return _spectrum(nm, daylight(nm * 1e-9))
    nm, power = _table("illuminants.csv")[1][0], _columns("illuminants.csv")[name]
    return _spectrum(nm, power / np.interp(NORMAL_NM, nm, power))


# The 24 patches of the ColorChecker, measured by Ohta (1997) and adopted by ISO 17321-1.
REFLECTANCES = (
    *("dark skin", "light skin", "blue sky", "foliage", "blue flower", "bluish green"),
    *("orange", "purplish blue", "moderate red", "purple", "yellow green", "orange yellow"),
    *("blue", "green", "red", "yellow", "magenta", "cyan"),
    *("white", "neutral 8", "neutral 6.5", "neutral 5", "neutral 3.5", "black"),
)


def reflectance(name: str) -> Spectrum:
    """Return the reflectance of a patch of the ColorChecker, measured on 380-780 nm and constant below 380 nm.

    name: name of the patch, such as "foliage" or "light skin"; `optics.spectra.spectrum.REFLECTANCES` has all names.

    Raises:
        ValueError: the name is unknown.
    """
    one_of("reflectance", name, REFLECTANCES)
    return _spectrum(_table("reflectances.csv")[1][0], _columns("reflectances.csv")[name])


def srgb_basis() -> tuple[Spectrum, Spectrum, Spectrum]:
    """Return the reflectances of a red, a green and a blue surface, from which every sRGB colour can be mixed.

    A surface with the reflectance r red + g green + b blue has the linear sRGB values (r, g, b) in daylight. The three
    reflectances add up to 1. Infinitely many other spectra have the same colours. The tables cover 380-780 nm, and
    values are constant below 380 nm.

    Source: Mallett & Yuksel (2019), Spectral primary decomposition for rendering with sRGB reflectance, EGSR.
    """
    nm, columns = _table("srgb_basis.csv")[1][0], _columns("srgb_basis.csv")
    red, green, blue = (_spectrum(nm, columns[name]) for name in ("red", "green", "blue"))
    return red, green, blue


def cone_fundamentals() -> tuple[Spectrum, Spectrum, Spectrum]:
    """Return the quantal sensitivities of human L, M and S cones at the cornea, with peaks of 1, for 2° fields.

    Source: Stockman & Sharpe (2000), Vision Research 40:1711, adopted by CIE 170-1:2006. The tables start at 390 nm,
    because lens and cornea transmit almost no light of shorter wavelengths.
    """
    nm = _table("cone_fundamentals.csv")[1][0]
    cones = (energy / nm for energy in _columns("cone_fundamentals.csv").values())
    long, middle, short = (Spectrum((nm[0] - 1, *nm), (0.0, *(quantal / quantal.max()))) for quantal in cones)
    return long, middle, short


def water_absorption() -> Spectrum:
    """Return the absorption coefficient of pure water [1/m], 300-780 nm.

    Sources: Pope & Fry (1997), Applied Optics 36:8710, at 380-725 nm; Smith & Baker (1981), Applied Optics 20:177, at
    other wavelengths. At 380 nm, the second table is higher by a factor of 2.
    """
    return _spectrum(*_table("water_absorption.csv")[1])


def phytoplankton_absorption() -> Spectrum:
    """Return the absorption of particles that contain chlorophyll, relative to that at 440 nm.

    Source: Prieur & Sathyendranath (1981), Limnology and Oceanography 26:671, at 400-700 nm.
    """
    return _spectrum(*_table("phytoplankton.csv")[1])
