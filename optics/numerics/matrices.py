"""Matrix products of Dr.Jit tensors, real and complex."""

from __future__ import annotations

from optics.numerics.autodiff import Array

__all__ = ["complex_flops", "complex_matmul", "matmul"]

Parts = tuple[Array, Array]
# Choice: size of a product, in multiplications, above which three products and extra sums cost less than four products.
THREE_PAY = 1e7


def matmul(left: Array, right: Array, transposed: bool = False) -> Array:
    """Return left @ right, or left @ rightᵀ if `transposed` is True."""
    import drjit as dr

    return dr.matmul(left, right, Bt=transposed)


def complex_matmul(left: Parts, right: Parts, transposed: bool = False) -> Parts:
    """Return the product of two matrices, each a pair of real and imaginary part.

    transposed: True to transpose (but not conjugate) `right`.
    """
    import drjit as dr

    dr.eval(left, right)  # one kernel for all, since separate kernels would compute common terms twice
    return _by_three(left, right, transposed) if _three_pay(left[0], right[0]) else _by_four(left, right, transposed)


def complex_flops(products: int) -> float:
    """Return the number of operations of a matrix product that multiplies `products` pairs of complex numbers."""
    return (6 if products > THREE_PAY else 8) * products


def _three_pay(left: Array, right: Array) -> bool:
    height, (down, across) = left.shape[0], right.shape
    return height * down * across > THREE_PAY  # correct for `right` and for its transpose


def _by_four(left: Parts, right: Parts, transposed: bool) -> Parts:
    (a, b), (c, d) = left, right
    return (
        matmul(a, c, transposed) - matmul(b, d, transposed),
        matmul(a, d, transposed) + matmul(b, c, transposed),
    )


def _by_three(left: Parts, right: Parts, transposed: bool) -> Parts:
    """Return the product of the matrices a + ib (`left`) and c + id (`right`) as real and imaginary part.

    The real part is ac - bd, and the imaginary part (a + b)(c + d) - ac - bd. Three real products thus replace four
    (Gauss's method). Relative to the norm of the product, the errors are as small as with four.
    """
    (a, b), (c, d) = left, right
    ac, bd = matmul(a, c, transposed), matmul(b, d, transposed)
    return ac - bd, matmul(a + b, c + d, transposed) - ac - bd
