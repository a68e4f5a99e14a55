"""Light to photoreceptor signal by wave optics. SI units; arrays are (wavelength, y, x)."""

from importlib import import_module
from typing import Any

_CONTENTS = {
    "AccuracyError": "planner",
    "BSplineRelief": "doe",
    "BackendError": "backend",
    "Annulus": "circular",
    "Circle": "circular",
    "Eye": "eye",
    "FreeSpace": "stack",
    "Grid": "grid",
    "HeightMap": "doe",
    "PSFBatch": "batch",
    "PSFResult": "point_spread",
    "PhotonBudget": "photon_budget",
    "Pigment": "pigment",
    "PixelRelief": "pixel_relief",
    "Plan": "planner",
    "PointSource": "source",
    "Polygon": "polygonal",
    "PropagationResult": "propagation",
    "Pupil": "pupil",
    "Receptors": "receptors",
    "RefractiveIndex": "refractive_index",
    "Relief": "doe",
    "Slit": "polygonal",
    "SpectralBands": "spectrum",
    "Spectrum": "tabulated",
    "StackResult": "stack",
    "encircled_energy": "quality",
    "illuminant": "tabulated",
    "image_quality": "quality",
    "mtf": "quality",
    "plan": "point_spread",
    "propagate": "propagation",
    "propagate_through": "stack",
    "psf": "point_spread",
    "psf_batch": "batch",
    "receptors_of": "receptors",
    "reflectance": "tabulated",
    "require": "backend",
    "strehl_ratio": "quality",
}

__all__ = sorted(_CONTENTS)


def __getattr__(name: str) -> Any:
    if name not in _CONTENTS:
        raise AttributeError(f"module 'optics' has no attribute {name!r}")
    value = getattr(import_module(f"optics.{_CONTENTS[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
