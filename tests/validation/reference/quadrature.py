"""Gauss-Legendre nodes for tests of the oracles, implemented independently of the oracles."""

import numpy as np


def gauss_legendre(n, low=0.0, high=1.0):
    nodes, weights = np.polynomial.legendre.leggauss(n)
    return low + (high - low) * (nodes + 1) / 2, (high - low) * weights / 2


def disk_nodes(radial=48, angular=96):
    """Return nodes ρ, θ and weights on the unit disk, which are exact for polynomials of degree below 90."""
    rho, weight = gauss_legendre(radial)
    theta = 2 * np.pi * np.arange(angular) / angular
    return rho[:, None], theta[None, :], np.broadcast_to((weight * rho)[:, None], (radial, angular))
