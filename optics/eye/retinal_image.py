"""Images on the retina, by convolution of the padded scene with kernels. The images are the reference for renderers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from optics.eye.receptor_lattice import ReceptorLattice, overlaps
from optics.numerics.autodiff import Array
from optics.numerics.field import Field
from optics.numerics.fourier import dft2, fast_length
from optics.numerics.grid import Grid
from optics.numerics.matrices import matmul
from optics.numerics.precision import Precision, padded_for_packets

__all__ = ["at_receptors", "blur", "centred", "mean_over", "receptor_average", "with_centre"]


def blur(
    scenes: Sequence[np.ndarray], kernels: Sequence[np.ndarray | Array], shape: tuple[int, int], types: Precision
) -> Array:
    """Return the sum of several scenes, each convolved with its own kernel.

    The value at the cell v in the band b is Σ_l Σ_u kernels[l][b, u] scenes[l][b, v - u], where l counts the scenes and
    u runs over the cells of a kernel. The result is the middle part of this image, a Dr.Jit tensor (band, *shape).

    scenes: arrays (band, Y, X). Beyond the borders of its array, a scene is dark.
    kernels: one tensor or array (band, ky, kx) per scene, with odd ky and kx.

    This is a convolution, not a correlation: a point of light at v produces the kernel around v. All arrays are in the
    orientation of the visual field. The origin of a kernel is its centre cell (ky//2, kx//2).
    """
    import drjit as dr

    bands = len(scenes[0])
    pairs = [(scene, _tensor(kernel, types)) for scene, kernel in zip(scenes, kernels, strict=True)]
    found = [_blurred([(scene[b], kernel[b]) for scene, kernel in pairs], shape, types) for b in range(bands)]
    return types.Tensor(found[0] if bands == 1 else dr.concat(found), (bands, *shape))


def _blurred(pairs: list[tuple[np.ndarray, Array]], shape: tuple[int, int], types: Precision) -> Array:
    """Return one band of the blurred image, the sum of several scenes that are each convolved with their own kernel.

    The result is the image's middle part, which has the size `shape`, as a flat array.

    pairs: for each scene, its radiance (Y, X) and its kernel (ky, kx).

    Fourier transforms repeat the image periodically. The period is so long that the repeated parts do not overlap the
    part that is returned.
    """
    if all(kernel.shape == (1, 1) for _, kernel in pairs):
        return sum(_flat(centred(scene, shape), types) * kernel.array for scene, kernel in pairs)
    # Parts of the scene beyond the kernel's reach have no effect, and parts of the kernel beyond the scene have none
    # either.
    needed = [
        (centred(scene, _within(scene.shape, shape, kernel.shape)), kernel[_middle(kernel.shape, shape, scene.shape)])
        for scene, kernel in pairs
    ]
    reach = max(sum(sizes) // 2 for a, b in needed for sizes in zip(a.shape, b.shape, shape, strict=True))
    period = fast_length(reach + 2)
    total: Field | None = None
    for scene, kernel in needed:
        product = _spectrum(_flat(scene, types), scene.shape, period, types)
        product = product * _spectrum(kernel.array, kernel.shape, period, types)
        total = product if total is None else total + product
    assert total is not None
    return dft2(total, period, shape, 1, 1.0).re / period**2


def _spectrum(flat: Array, shape: tuple[int, ...], period: int, types: Precision) -> Field:
    import drjit as dr

    field = Field(flat, dr.zeros(types.Float, flat.shape[0]), Grid((shape[0], shape[1]), 1.0), types)
    return dft2(field, period, (period, period), -1, 1.0)


def _tensor(kernel: np.ndarray | Array, types: Precision) -> Array:
    if isinstance(kernel, np.ndarray):
        return types.Tensor(_flat(kernel, types), kernel.shape)
    return kernel


def _flat(array: np.ndarray, types: Precision) -> Array:
    return types.Float(padded_for_packets(np.asarray(array, types.complex_dtype(0).real.dtype)))


def _within(scene: tuple[int, ...], shape: tuple[int, int], kernel: tuple[int, ...]) -> tuple[int, int]:
    """Return the size of the part of the scene that affects the image's middle part, whose size is `shape`.

    It is at most the scene's size and has the same parity.
    """
    height, width = (n - 2 * max(0, (n - m - k + 1) // 2) for n, m, k in zip(scene, shape, kernel, strict=True))
    return height, width


def _middle(kernel: tuple[int, ...], shape: tuple[int, int], scene: tuple[int, ...]) -> tuple[slice, slice]:
    """Return slices of the part of a kernel that contributes to the middle part of the blurred image.

    kernel, shape, scene: sizes (y, x) of the kernel, of this middle part and of the scene.
    """
    cuts = [max(0, k // 2 - (m + n) // 2) for k, m, n in zip(kernel, shape, scene, strict=True)]
    rows, columns = (slice(cut, k - cut) for cut, k in zip(cuts, kernel, strict=True))
    return rows, columns


def centred(image: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Return the middle part, of size `shape`, of an image (…, Y, X).

    Raises:
        ValueError: the image is smaller than `shape`, or the margins on both sides are not equal.
    """
    margins = [size - n for size, n in zip(image.shape[-2:], shape, strict=True)]
    if any(margin < 0 or margin % 2 for margin in margins):
        raise ValueError(
            f"radiance has {image.shape[-2]} x {image.shape[-1]} cells: must exceed {shape[0]} x {shape[1]} "
            "(receptors x samples_per_receptor) by even numbers, to be centred on the axis"
        )
    top, left = (margin // 2 for margin in margins)
    return image[..., top : top + shape[0], left : left + shape[1]]


def receptor_average(image: Array, samples_per_receptor: int, types: Precision) -> Array:
    """Return the mean of an image over each receptor, a Dr.Jit tensor (band, row, column) with one value per receptor.

    image: Dr.Jit tensor (band, y, x). Its samples belong to the equal cells into which each receptor is divided.
    samples_per_receptor: number of cells along each side of a receptor.
    """
    return _of_receptors(image, np.full(samples_per_receptor, 1 / samples_per_receptor), types)


def mean_over(lattice: ReceptorLattice, image: Array, types: Precision) -> Array:
    """Return the mean of an image over each receptor's rectangle.

    The result is a Dr.Jit tensor (band, row, column) with one value per receptor.

    image: Dr.Jit tensor (band, y, x). Its values belong to equal cells, into which the retina is divided. The image is
        constant within a cell.
    """
    import drjit as dr

    (height, width), (bands, down, across) = lattice.areas.shape, image.shape
    shares = overlaps((lattice.rows + height / 2) * down / height, down)
    rows = matmul(types.Tensor(shares / shares.sum(axis=1, keepdims=True)), image)
    edges = (lattice.columns + width / 2) * across / width
    first = np.clip(np.floor(edges[:, :-1]).astype(int), 0, across - 1)
    # The same number of cells is summed for all receptors. Cells that do not overlap a receptor have the weight 0.
    cells = first[..., None] + np.arange(int(np.ceil(edges[:, 1:] - first).max()))
    left, right = edges[:, :-1, None], edges[:, 1:, None]
    weights = np.clip(right - cells, 0, 1) - np.clip(left - cells, 0, 1)
    weights /= weights.sum(axis=-1, keepdims=True)
    starts = (np.arange(bands)[:, None] * height + np.arange(height))[..., None, None] * across
    index = (starts + np.minimum(cells, across - 1)).ravel().astype(np.uint32)
    seen = types.Tensor(
        dr.gather(types.Float, rows.array, types.Index(padded_for_packets(index))), (bands, *cells.shape)
    )
    return dr.sum(seen * types.Tensor(weights[None]), axis=3)


def at_receptors(image: Array, samples_per_receptor: int, types: Precision) -> Array:
    """Return the image's value in the cell at each receptor's middle.

    If the number of cells along a receptor's side is even, the middle lies between cells. The value is then that of the
    cell after the middle along y and x. This value belongs to the middle only if the image was computed with kernels
    that `with_centre` has shifted by half a cell.
    """
    return _of_receptors(image, np.arange(samples_per_receptor) == samples_per_receptor // 2, types)


def with_centre(kernel: Array) -> Array:
    """Return a kernel (band, ky, kx) with odd ky and kx.

    An even side is extended by one cell, which shifts the kernel by half a cell.
    """
    odd = [(side + 1) % 2 for side in kernel.shape[1:]]
    return type(kernel)(np.pad(kernel.numpy(), ((0, 0), *((more, 0) for more in odd)))) if any(odd) else kernel


def _of_receptors(image: Array, shares: np.ndarray, types: Precision) -> Array:
    """Return weighted sums of an image over each receptor, (band, receptor row, receptor column).

    image: values (band, y, x) in the equal cells into which each receptor is divided.
    shares: weights of the rows of cells in a receptor, (row,). The columns of cells have the same weights. The weight
        of a cell is the product of both.
    """
    down, across = (types.Tensor(np.kron(np.eye(n // len(shares)), shares)) for n in image.shape[1:])
    return matmul(down, matmul(image, across, transposed=True))
