"""Image on the retina of a scene with many distances: layers, composited over one another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from optics.eye.kernel_bank import KernelBank
from optics.eye.occlusion import Layer, visible_layers
from optics.eye.retinal_image import blur
from optics.numerics.autodiff import Array
from optics.numerics.precision import Precision

__all__ = ["retinal_image"]

SMALLEST = 1e-6  # avoids 0/0


def retinal_image(
    light: np.ndarray, inverse_distance: np.ndarray, bank: KernelBank, shape: tuple[int, int], types: Precision
) -> Array:
    """Return the image of a scene whose near surfaces hide far ones (see `occlusion`), Dr.Jit (band, row, column).

    If `bank.parallax` is 0, no surface hides another one.

    light: radiance (band, Y, X) of the cells, the equal rectangles into which the scene is divided.
    inverse_distance: 1/z [1/m] of the cells, (Y, X).
    shape: numbers of rows and columns of the image.
    """
    scene = _Scene(light, inverse_distance, bank, shape, types)
    if bank.parallax == 0 or np.ptp(inverse_distance) == 0:
        return scene.image(np.arange(light[0].size).reshape(light[0].shape), np.ones(light[0].shape, bool))
    total: Any = 0
    passing: Any = 1
    cells = np.zeros(inverse_distance.shape, bool)
    source = np.zeros(inverse_distance.shape, int)
    for layer in visible_layers(inverse_distance, bank.parallax):
        source, cells = np.where(layer.cells, layer.source, source), cells | layer.cells
        if layer.hiding.any():
            total += passing * scene.image(source, cells)
            passing *= scene.passing(layer)
            cells = np.zeros_like(cells)
    return total + passing * scene.image(source, cells) if cells.any() else total


@dataclass(frozen=True)
class _Scene:
    """A scene with the kernels that blur it.

    Cells are the equal rectangles into which the scene is divided. Arguments `source` and `cells` of the methods are
    arrays (Y, X) with one entry per cell. An entry of `source` is the flat index of the cell whose light and distance
    are used in place of the cell's own: the cell itself, or another cell. An entry of `cells` is True if the cell is
    selected.
    """

    light: np.ndarray
    inverse_distance: np.ndarray
    bank: KernelBank
    shape: tuple[int, int]
    types: Precision

    def image(self, source: np.ndarray, cells: np.ndarray) -> Array:
        """Return the image (band, *shape) that selected cells of the scene form on the retina.

        For the arguments, see `_Scene`.
        """
        seen = self.light.reshape(len(self.light), -1)[:, source]
        return self._blurred([seen * share for share in self._shares(source, cells)], self.kernels)

    def passing(self, layer: Layer) -> Array:
        """Return the fraction of the light from farther layers that passes a layer, at each cell of the retina.

        Cells are the equal rectangles into which the scene and the retina are divided. A layer contains the cells of
        the scene in one range of distances. There are two kinds of them. Hiding cells lie in front of a farther
        surface. The other cells belong to a surface that continues in a farther layer. They hide nothing, but the
        farther layer has no cells at their positions. Seen from a cell of the retina, the hiding cells cover a fraction
        h of the pupil, and the other cells a fraction g. Light of the farther layer then comes only through the
        fraction 1 - g of the pupil, so the passing fraction is 1 - h/(1 - g). The result has the axes (band, row,
        column).
        """
        import drjit as dr

        hidden = self._coverage(layer.source, layer.hiding)
        continued = layer.cells & ~layer.hiding
        if continued.any():
            hidden /= dr.maximum(1 - self._coverage(layer.source, continued), SMALLEST)
        return dr.clip(1 - hidden, 0, 1)

    def _coverage(self, source: np.ndarray, cells: np.ndarray) -> Array:
        """Return the fraction of the pupil that selected cells of the scene cover, seen from each cell of the retina.

        Cells are the equal rectangles into which the scene and the retina are divided. For the arguments, see `_Scene`.
        The result has the axes (band, row, column).
        """
        ones = np.ones_like(self.light)
        return self._blurred([ones * share for share in self._shares(source, cells)], self._whole)

    @property
    def kernels(self) -> list[Array]:
        return list(self.bank.kernels.values())

    @cached_property
    def _whole(self) -> list[Array]:
        """Kernels with a sum of 1 in each band."""
        import drjit as dr

        sums = [dr.maximum(dr.sum(kernel, axis=(1, 2)), SMALLEST) for kernel in self.kernels]
        return [kernel / dr.reshape(one, (-1, 1, 1)) for kernel, one in zip(self.kernels, sums, strict=True)]

    def _shares(self, source: np.ndarray, cells: np.ndarray) -> list[np.ndarray]:
        """Return one array (Y, X) for each kernel of `bank`: the kernel's interpolation weight in each scene cell.

        The weights are 0 in cells that `cells` does not select. For the arguments, see `_Scene`.
        """
        return [share * cells for share in self.bank.shares(self.inverse_distance.ravel()[source])]

    def _blurred(self, scenes: list[np.ndarray], kernels: list[Array]) -> Array:
        """Return the sum of the scenes, each blurred by its own kernel; dark scenes are omitted."""
        bright = [i for i, scene in enumerate(scenes) if scene.any()] or [0]
        return blur([scenes[i] for i in bright], [kernels[i] for i in bright], self.shape, self.types)
