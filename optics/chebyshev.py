"""Chebyshev points and the Lagrange polynomials through them."""

from __future__ import annotations

import numpy as np

__all__ = ["chebyshev_points", "lagrange"]


def chebyshev_points(n: int) -> np.ndarray:
    """Chebyshev points of the first kind on [-1, 1]."""
    return np.cos(np.pi * (np.arange(n) + 0.5) / n)


def lagrange(x: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """(node, *x.shape): the Lagrange polynomials of the nodes at x."""
    basis = np.ones((len(nodes), *np.shape(x)))
    for i, node in enumerate(nodes):
        for other in np.delete(nodes, i):
            basis[i] *= (x - other) / (node - other)
    return basis
