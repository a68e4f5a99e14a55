"""The five tables of optics/spectra/data, exported from colour-science

    python -m validation.optics.freeze_spectra [--write]

Without --write it compares the data of colour-science with the stored files byte for byte, lists files that differ, and
exits with 1 if there are any. Sources and licence: optics/spectra/data/README.md.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

DATA = Path(__file__).resolve().parents[2] / "optics" / "spectra" / "data"
FROM_300 = np.arange(300, 781, 5)
FROM_380 = np.arange(380, 781, 5)
FROM_390 = np.arange(390, 781, 5)
ILLUMINANTS = ("A", "D50", "D55", "D75", "FL2", "FL11", "LED-B3")
# colour-science names neutral patches with their Munsell value and density.
PATCHES = {"white 9.5 (.05 D)": "white", "black 2 (1.5 D)": "black"}


def colour_tables() -> dict[str, np.ndarray]:
    """Return CIE D65, and the colour matching functions of 1931 (0 below 360 nm, outside their table)."""
    import colour

    matching = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    names = ("x_bar", "y_bar", "z_bar")
    return {"wavelength_nm": FROM_300, "d65": _power("D65"), **dict(zip(names, _at(matching, FROM_300).T, strict=True))}


def illuminants() -> dict[str, np.ndarray]:
    """Return illuminants except D65 and E, 0 at wavelengths without an entry."""
    return {"wavelength_nm": FROM_300, **{name: _power(name) for name in ILLUMINANTS}}


def reflectances() -> dict[str, np.ndarray]:
    """Return the ColorChecker's patches after Ohta."""
    import colour

    chart = colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"]
    return {"wavelength_nm": FROM_380, **{_patch(name): _at(patch, FROM_380) for name, patch in chart.items()}}


def cone_fundamentals() -> dict[str, np.ndarray]:
    """Return the human cones' sensitivities at the cornea, in units of energy."""
    import colour

    cones = colour.MSDS_CMFS["Stockman & Sharpe 2 Degree Cone Fundamentals"]
    return {"wavelength_nm": FROM_390, **dict(zip("LMS", _at(cones, FROM_390).T, strict=True))}


def srgb_basis() -> dict[str, np.ndarray]:
    """Return the reflectances of the primaries of sRGB after Mallett & Yuksel."""
    import colour

    basis = colour.recovery.MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019
    return {"wavelength_nm": FROM_380, **dict(zip(("red", "green", "blue"), _at(basis, FROM_380).T, strict=True))}


TABLES: dict[str, Callable[[], dict[str, np.ndarray]]] = {
    "colour_tables.csv": colour_tables,
    "cone_fundamentals.csv": cone_fundamentals,
    "illuminants.csv": illuminants,
    "reflectances.csv": reflectances,
    "srgb_basis.csv": srgb_basis,
}


def _power(illuminant: str) -> np.ndarray:
    import colour

    return _at(colour.SDS_ILLUMINANTS[illuminant], FROM_300)


def _at(spectrum: Any, wavelengths: np.ndarray) -> np.ndarray:
    """Return entries of the table itself, 0 where missing; indexing in colour-science would interpolate and round."""
    known = dict(zip(spectrum.wavelengths, spectrum.values, strict=True))
    return np.array([known.get(float(nm), 0 * spectrum.values[0]) for nm in wavelengths])


def _patch(name: str) -> str:
    return PATCHES.get(name, name.split(" (")[0])


def text(columns: dict[str, np.ndarray]) -> str:
    """Return CSV text: numbers with the fewest digits that identify them."""
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(repr(float(value)).removesuffix(".0") for value in row) for row in rows)]
    return "\n".join(lines) + "\n"


def main() -> int:
    assert __doc__
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--write", action="store_true", help="write the files instead of comparing them")
    asked = options.parse_args()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # colour-science warns about optional packages that are irrelevant here
        found = {name: text(table()) for name, table in TABLES.items()}
    if asked.write:
        for name, table in found.items():
            (DATA / name).write_text(table)
        return 0
    differing = [name for name, table in found.items() if (DATA / name).read_text() != table]
    print("\n".join(f"differs: {name}" for name in differing) or f"all {len(found)} tables equal the stored ones")
    return 1 if differing else 0


if __name__ == "__main__":
    raise SystemExit(main())
