"""Differences between results, and their orders of convergence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

__all__ = ["order_of_convergence", "relative_l2"]


def relative_l2(value: np.ndarray, reference: np.ndarray, weight: np.ndarray | float = 1.0) -> float:
    """Return √(Σ w |a - b|² / Σ w |b|²) for real or complex arrays; w = r over radial samples weights by area."""
    a, b = (np.asarray(each, dtype=np.result_type(each, np.float64)) for each in (value, reference))
    return float(np.sqrt(np.sum(weight * np.abs(a - b) ** 2) / np.sum(weight * np.abs(b) ** 2)))


def order_of_convergence(size: Sequence[float], error: Sequence[float]) -> float:
    """Return the exponent p in error ~ size^p, the least-squares slope in double logarithms."""
    return float(np.polyfit(np.log(np.asarray(size)), np.log(np.asarray(error)), 1)[0])
