"""Matrix products of Dr.Jit tensors, real and complex."""

from __future__ import annotations

from optics.numerics.autodiff import Array

__all__ = ["complex_flops", "complex_matmul", "matmul"]

Parts = tuple[Array, Array]
THREE_PAY = 1e7  # choice: multiplications, above which a fourth product costs more than three sums


def matmul(left: Array, right: Array, transposed: bool = False) -> Array:
    """left @ right, or left @ rightᵀ."""
    import drjit as dr

    return dr.matmul(left, right, Bt=transposed)


def complex_matmul(left: Parts, right: Parts, transposed: bool = False) -> Parts:
    """The same of matrices that are given as their real and imaginary parts (transposed, not conjugated)."""
    import drjit as dr

    dr.eval(left, right)  # at once: one after the other, each part computes what they share
    return _by_three(left, right, transposed) if _three_pay(left[0], right[0]) else _by_four(left, right, transposed)


def complex_flops(products: int) -> float:
    """Of a matrix product that multiplies so many pairs of complex numbers."""
    return (6 if products > THREE_PAY else 8) * products


def _three_pay(left: Array, right: Array) -> bool:
    height, (down, across) = left.shape[0], right.shape
    return height * down * across > THREE_PAY  # whichever of the two is summed over


def _by_four(left: Parts, right: Parts, transposed: bool) -> Parts:
    (a, b), (c, d) = left, right
    return (
        matmul(a, c, transposed) - matmul(b, d, transposed),
        matmul(a, d, transposed) + matmul(b, c, transposed),
    )


def _by_three(left: Parts, right: Parts, transposed: bool) -> Parts:
    """ac - bd and (a + b)(c + d) - ac - bd: three products in the place of four (Gauss), as exact in the norm."""
    (a, b), (c, d) = left, right
    ac, bd = matmul(a, c, transposed), matmul(b, d, transposed)
    return ac - bd, matmul(a + b, c + d, transposed) - ac - bd
