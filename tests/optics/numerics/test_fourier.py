"""dft2: FFT and matrices give the same sums, for every parity, folding and tiling, and the adjoint is correct."""

import drjit as dr
import numpy as np
import pytest
from scipy.fft import next_fast_len

from optics.numerics import fourier, fourier_matrices, matrices
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.precision import precision

SINES = 60  # operations; a kernel with sine and cosine has more
WAYS = [fourier._fft, fourier_matrices.by_halves, fourier_matrices.by_whole_matrices]
CASES = [((5, 6), 8, (4, 3)), ((7, 8), 12, (12, 12)), ((17, 20), 6, (5, 6)), ((9, 4), 5, (13, 11)), ((6, 6), 6, (6, 6))]


def by_definition(u, period, shape, sign):
    def matrix(n_out, n_in):
        return np.exp(sign * 2j * np.pi * np.outer(np.arange(n_out) - n_out // 2, np.arange(n_in) - n_in // 2) / period)

    return matrix(shape[0], u.shape[0]) @ u @ matrix(shape[1], u.shape[1]).T


def random_field(shape, dtype="float64", seed=0):
    rng = np.random.default_rng(seed)
    u = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    return u, Field.from_numpy(u, 1.0, precision(dtype))


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize(("shape", "period", "out"), CASES)
@pytest.mark.parametrize("way", WAYS)
def test_sum_is_as_defined(way, shape, period, out, sign):
    u, field = random_field(shape)
    re, im = way(field, period, out, sign)
    result = (re.numpy() + 1j * im.numpy()).reshape(out)
    np.testing.assert_allclose(result, by_definition(u, period, out, sign), atol=1e-12)


def test_period_need_not_be_whole():
    u, field = random_field((9, 12))
    result = fourier.dft2(field, 17.3, (7, 10), -1, 1.0).numpy()
    np.testing.assert_allclose(result, by_definition(u, 17.3, (7, 10), -1), atol=1e-12)


def test_float32_carries_six_digits():
    u, field = random_field((200, 200), "float32")
    for way in WAYS:
        re, im = way(field, 256, (256, 256), -1)
        exact = by_definition(u, 256, (256, 256), -1)
        error = np.linalg.norm((re.numpy() + 1j * im.numpy()).reshape(256, 256) - exact) / np.linalg.norm(exact)
        assert error < 1e-6


@pytest.mark.parametrize("transposed", [False, True])
@pytest.mark.parametrize("across", [3, 300])
def test_complex_products_by_four_and_by_three(across, transposed, monkeypatch):
    """Larger products use three real products instead of four."""
    asked, product = [], matrices.matmul
    monkeypatch.setattr(matrices, "matmul", lambda *args: asked.append(args) or product(*args))
    rng = np.random.default_rng(2)
    left, right = (rng.normal(size=shape) + 1j * rng.normal(size=shape) for shape in ((300, 200), (200, across)))
    given = right.T if transposed else right
    types = precision("float64")
    parts = [tuple(types.Tensor(np.ascontiguousarray(part)) for part in (u.real, u.imag)) for u in (left, given)]
    re, im = matrices.complex_matmul(*parts, transposed=transposed)
    np.testing.assert_allclose(re.numpy() + 1j * im.numpy(), left @ right, atol=1e-11)
    assert len(asked) == (3 if across == 300 else 4)


@pytest.mark.parametrize("way", WAYS)
def test_parts_of_a_field_are_computed_together(way):
    """The real and the imaginary part use the same sines. If they were evaluated separately, the sines would be
    computed twice.
    """
    types, grid = precision("float32"), Grid.square(256, 1.0)
    x, y = grid.coordinates(types)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        re, im = way(Field.from_waves(1.0, dr.sqrt(x * x + y * y), grid, types), 256, (256, 256), -1)
        dr.eval(re, im)
        kernels = [kernel for kernel in dr.kernel_history() if kernel["type"] == dr.KernelType.JIT]
    with_sines = [kernel for kernel in kernels if kernel["size"] == 256 * 256 and kernel["operation_count"] > SINES]
    assert len(with_sines) == 1  # the field's kernel; a matrix of that size is computed in the same one


@pytest.mark.parametrize("way", WAYS)
def test_derivative_is_the_adjoint(way):
    """For a linear sum, the derivative of Σ (w·re + v·im) with respect to u is the adjoint of the sum, applied to (w,
    v).
    """
    _, field = random_field((5, 6))
    (w, v), out = np.random.default_rng(1).normal(size=(2, 42)), (6, 7)
    dr.enable_grad(field.re, field.im)
    re, im = way(field, 11, out, 1)
    loss = dr.sum(re * type(re)(w) + im * type(re)(v))
    dr.backward(loss)
    adjoint = by_definition((w + 1j * v).reshape(out), 11, (5, 6), -1)
    np.testing.assert_allclose(field.re.grad.numpy(), adjoint.real.ravel(), atol=1e-12)
    np.testing.assert_allclose(field.im.grad.numpy(), adjoint.imag.ravel(), atol=1e-12)


@pytest.mark.parametrize("way", [fourier_matrices.by_halves, fourier_matrices.by_whole_matrices])
def test_derivative_by_the_period(way):
    """The reference is a difference of fourth order."""
    _, field = random_field((9, 6))
    weight, step = field.types.Float(np.random.default_rng(1).normal(size=56)), 1e-3

    def loss(period):
        re, im = way(field, period, (7, 8), -1)
        return dr.sum(weight * (re + 2 * im))

    period = field.types.Float64(11.3)
    dr.enable_grad(period)
    dr.backward(loss(period))
    far, near = (loss(11.3 + k * step)[0] - loss(11.3 - k * step)[0] for k in (2, 1))
    assert period.grad[0] == pytest.approx((8 * near - far) / (12 * step), rel=1e-8)


def test_large_sums_go_by_halves():
    assert fourier_matrices.halves_pay((300, 300), (500, 500))
    assert not fourier_matrices.halves_pay((33, 33), (65, 65))


def test_small_windows_go_by_matrix_and_large_ones_by_fft():
    assert not fourier._fft_wins((400, 400), 800, (20, 20))
    assert fourier._fft_wins((1000, 1000), 2000, (2000, 2000))
    assert not fourier._fft_wins((1000, 1000), 2000.5, (2000, 2000))


def test_fast_lengths_are_the_next_without_large_factors():
    lengths = [*range(1, 3000), 999_999, 2**31 - 1]
    assert [fourier.fast_length(n) for n in lengths] == [next_fast_len(n, real=True) for n in lengths]
    assert fourier.fast_length(7.2) == 8
    assert fourier.fast_length(2.0**40 - 0.5) == 2**40
