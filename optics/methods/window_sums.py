"""Sums over the pupil for all samples of a window, and the adjoint of these sums, as stacked matrix products.

    U[y, x] = Σ_ba Σ_ηξ down[y, bη] P[η, ξ] kernel[b, a, η, ξ] across[x, aξ]

The diffraction kernel is a Fourier kernel times a factor that varies slowly over the window, the slow factor. The slow
factor is interpolated between the points (b, a) of the window. The number of these points along an axis is the rank.

P is the light behind the pupil, times the areas of its samples. `down` and `across` are Fourier kernels times the
interpolation weights of the points, and `kernel` is the slow factor at the points, times 1/(iλz). `down` may also
contain the values of the slow factor along the y axis of the window, and `across` those along the x axis. `kernel` is
then divided by these values. At rank 1, there is one point, and U is the matrix Fourier transform of the product
P · kernel. `down`, `across` and `kernel` describe the geometry alone, so they are shared by all light of one wavelength
that passes the same samples.

`window_field` and `pupil_gradient` accept arrays of any library with the operators of NumPy, such as PyTorch, and any
number of leading axes (pupil, depth, wavelength), which are broadcast.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.numerics.autodiff import Array, Scalar, carries_derivative
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.precision import Precision, padded_for_packets

__all__ = ["WindowSums", "intensity_of", "pupil_gradient", "recorded_field", "weighted", "window_field"]


def window_field(pupil: Any, kernel: Any, down: Any, across: Any) -> Any:
    """Return the field U over the window, (..., y, x), complex.

    η and ξ count the rows and columns of samples of the pupil. b and a count the rows and columns of interpolation
    points in the window.

    pupil: light behind the pupil times the areas of the samples, (..., η, ξ), complex.
    kernel: slow factor, the quotient of the diffraction kernel and a Fourier kernel, at the interpolation points,
        (..., b, a, η, ξ), complex.
    down, across: Fourier kernels along y and x, times the interpolation weights of the points, (..., y, b·η) and
        (..., x, a·ξ), complex.
    """
    return down @ weighted(pupil, kernel) @ across.swapaxes(-1, -2)


def pupil_gradient(cotangent: Any, kernel: Any, down: Any, across: Any) -> Any:
    """Return the gradient of a loss L with respect to the pupil's light P, ∂L/∂Re P + i ∂L/∂Im P, (..., η, ξ).

    This function is the adjoint of `window_field`, which returns U, and takes about as much time as `window_field`.

    cotangent: ∂L/∂Re U + i ∂L/∂Im U, (..., y, x). For a loss on the intensity |U|², it is 2U ∂L/∂|U|².
    """
    inner = down.conj().swapaxes(-1, -2) @ cotangent @ across.conj()
    rows, columns, height, width = kernel.shape[-4:]
    split = inner.reshape((*inner.shape[:-2], rows, height, columns, width)).swapaxes(-3, -2)
    return (split * kernel.conj()).sum((-4, -3))


def weighted(pupil: Any, kernel: Any) -> Any:
    """Return pupil[η, ξ] · kernel[b, a, η, ξ] as matrices (..., b·η, a·ξ)."""
    rows, columns, height, width = kernel.shape[-4:]
    if rows == columns == 1:
        return pupil * kernel[..., 0, 0, :, :]
    product = (pupil[..., None, None, :, :] * kernel).swapaxes(-3, -2)
    return product.reshape((*product.shape[:-4], rows * height, columns * width))


def intensity_of(field: Any) -> Any:
    """Return the intensity |U|² of a field U, as an array of the same library as `field`."""
    re, im = field.real, field.imag
    return re * re + im * im


@dataclass(frozen=True, eq=False)
class WindowSums:
    """The arrays with which `window_field` computes the field of one pupil, at one wavelength, over one window.

    by_distance: function that returns the derivative [1/m³] of `kernel` [1/m²] with respect to the window's distance.
    """

    kernel: np.ndarray
    down: np.ndarray
    across: np.ndarray
    by_distance: Callable[[], np.ndarray]

    def field(self, pupil: np.ndarray) -> np.ndarray:
        found: np.ndarray = window_field(pupil, self.kernel, self.down, self.across)
        return found

    def gradient(self, cotangent: np.ndarray) -> np.ndarray:
        found: np.ndarray = pupil_gradient(cotangent, self.kernel, self.down, self.across)
        return found

    def moved(self, pupil: np.ndarray) -> np.ndarray:
        """Return the derivative of the field with respect to the distance of the window."""
        found: np.ndarray = window_field(pupil, self.by_distance(), self.down, self.across)
        return found


def recorded_field(pupil: Field, distance: Scalar, sums: WindowSums, window: Grid) -> Field:
    """Return the field over the window, with derivatives with respect to the pupil's light and the distance."""
    import drjit as dr

    types, shape = pupil.types, pupil.grid.shape
    moves = carries_derivative(distance)

    class WindowField(dr.CustomOp):
        """The sum over the pupil (`WindowSums.field`) as one operation of Dr.Jit.

        The operation keeps the light of the pupil, because the derivative with respect to the distance depends on it.
        """

        def eval(self, re: Array, im: Array, distance: Array) -> tuple[Array, Array]:
            self.pupil = _complex(re, im, shape)
            return _parts(sums.field(self.pupil), types)

        def forward(self) -> None:
            changed = sums.field(_complex(self.grad_in("re"), self.grad_in("im"), shape))
            if moves:
                step: Array = self.grad_in("distance")
                changed = changed + sums.moved(self.pupil) * step.numpy()[0]
            self.set_grad_out(_parts(changed, types))

        def backward(self) -> None:
            parts: Array = self.grad_out()
            cotangent = _complex(parts[0], parts[1], window.shape)
            re, im = _parts(sums.gradient(cotangent), types)
            self.set_grad_in("re", re)
            self.set_grad_in("im", im)
            if moves:
                self.set_grad_in("distance", types.Float64(float(np.vdot(cotangent, sums.moved(self.pupil)).real)))

    place = types.Float64(dr.ravel(distance)) if moves else types.Float64(0)
    return Field(*dr.custom(WindowField, pupil.re, pupil.im, place), window, types)


def _parts(values: np.ndarray, types: Precision) -> tuple[Array, Array]:
    """Return real and imaginary part as flat Dr.Jit arrays."""
    return types.Float(padded_for_packets(values.real)), types.Float(padded_for_packets(values.imag))


def _complex(re: Array, im: Array, shape: tuple[int, int]) -> np.ndarray:
    """Return two flat Dr.Jit arrays as one complex NumPy array."""
    import drjit as dr

    dr.eval(re, im)  # one kernel for both, since separate kernels would compute their common terms twice
    parts = re.numpy(), im.numpy()
    found = np.empty(shape, np.result_type(parts[0], np.complex64))
    found.real, found.imag = (part.reshape(shape) for part in parts)
    return found
