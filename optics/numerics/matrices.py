"""Matrix products of Dr.Jit tensors, real and complex."""

from __future__ import annotations

from optics.numerics.autodiff import Array

__all__ = ["complex_flops", "complex_matmul", "matmul"]

Parts = tuple[Array, Array]
THREE_PAY = 1e7  # choice: number of multiplications above which a fourth product costs more than three sums


def matmul(left: Array, right: Array, transposed: bool = False) -> Array:
    """Return left @ right, or left @ rightᵀ."""
    import drjit as dr

    return dr.matmul(left, right, Bt=transposed)


def complex_matmul(left: Parts, right: Parts, transposed: bool = False) -> Parts:
    """Return the product of matrices that are given as real and imaginary parts (transposed, not conjugated)."""
    import drjit as dr

    dr.eval(left, right)  # in one kernel; separate kernels would compute common terms again
    return _by_three(left, right, transposed) if _three_pay(left[0], right[0]) else _by_four(left, right, transposed)


def complex_flops(products: int) -> float:
    """Return the operations of a matrix product that multiplies `products` pairs of complex numbers."""
    return (6 if products > THREE_PAY else 8) * products


def _three_pay(left: Array, right: Array) -> bool:
    height, (down, across) = left.shape[0], right.shape
    return height * down * across > THREE_PAY  # valid for both orientations of `right`


def _by_four(left: Parts, right: Parts, transposed: bool) -> Parts:
    (a, b), (c, d) = left, right
    return (
        matmul(a, c, transposed) - matmul(b, d, transposed),
        matmul(a, d, transposed) + matmul(b, c, transposed),
    )


def _by_three(left: Parts, right: Parts, transposed: bool) -> Parts:
    """Return ac - bd and (a + b)(c + d) - ac - bd.

    Three products replace four (Gauss). The result is equally accurate in the norm.
    """
    (a, b), (c, d) = left, right
    ac, bd = matmul(a, c, transposed), matmul(b, d, transposed)
    return ac - bd, matmul(a + b, c + d, transposed) - ac - bd
