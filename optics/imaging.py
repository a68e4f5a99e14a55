"""Images on the retina: convolution of the padded scene with the kernel. The reference other renderers must meet."""

from __future__ import annotations

import numpy as np

__all__ = ["blur", "receptor_average"]


def blur(radiance: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """Σ_u kernel[b, u] radiance[b, v - u], dark outside: (band, Y, X) -> (band, Y, X).

    A convolution, not a correlation: a point of light at v shows the kernel around v. Both arrays are in visual-field
    orientation; the kernel's centre cell (ky//2, kx//2) is its origin, ky and kx are odd.
    """
    from scipy.signal import fftconvolve

    if kernel.shape[1:] == (1, 1):
        return radiance * kernel
    return fftconvolve(radiance, kernel, mode="same", axes=(1, 2)).astype(np.float32)


def receptor_average(image: np.ndarray, resolution: tuple[int, int], samples_per_receptor: int) -> np.ndarray:
    """Mean over each receptor's square aperture; receptors lie centred in the image: (band, Y, X) -> (band, h, w).

    Raises:
        ValueError: the image's margins around the receptors are not equal on both sides.
    """
    s = samples_per_receptor
    margins = [size - n * s for size, n in zip(image.shape[1:], resolution, strict=True)]
    if any(margin < 0 or margin % 2 for margin in margins):
        raise ValueError(
            f"radiance has {image.shape[1]} x {image.shape[2]} cells: must exceed {resolution[0] * s} x "
            f"{resolution[1] * s} (receptors x samples_per_receptor) by even numbers, to be centred on the axis"
        )
    top, left = (margin // 2 for margin in margins)
    (h, w), bands = resolution, len(image)
    seen = image[:, top : top + h * s, left : left + w * s]
    return seen.reshape(bands, h, s, w, s).mean(axis=(2, 4))
