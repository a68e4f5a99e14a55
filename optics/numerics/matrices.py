"""Matrix products of Dr.Jit tensors, real and complex."""

from __future__ import annotations

from optics.numerics.autodiff import Array

__all__ = ["complex_matmul", "matmul"]


def matmul(left: Array, right: Array, transposed: bool = False) -> Array:
    """left @ right, or left @ rightᵀ."""
    import drjit as dr

    return dr.matmul(left, right, Bt=transposed)


def complex_matmul(
    left: tuple[Array, Array], right: tuple[Array, Array], transposed: bool = False
) -> tuple[Array, Array]:
    """The same of matrices that are given as their real and imaginary parts (transposed, not conjugated)."""
    (a, b), (c, d) = left, right
    return (
        matmul(a, c, transposed) - matmul(b, d, transposed),
        matmul(a, d, transposed) + matmul(b, c, transposed),
    )
