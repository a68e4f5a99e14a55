"""A slow reference for the fast renderer: Mitsuba's integrators render an image, and `optics.Eye.see` blurs it.

It uses the same world model and the same places of the eyes as the batched renderer, but computes light independently.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

import mujoco
import numpy as np

import optics
from optics.numerics.arguments import reals, shown, whole
from sim.eyes.eyes import EYE_HEIGHT, Eyes, camera_rotations, eye_positions
from sim.eyes.receptive_fields import cells_for
from sim.render.world_scene import require_eyes_in_world
from sim.scene.band_error import lights_in_bands
from sim.scene.cameras import Viewpoint
from sim.scene.mirror import MirrorWarning, mirror
from sim.scene.rays import MOST_SAMPLES, MOST_SEED
from sim.worlds.state import WorldState, pose
from sim.worlds.world import World

MOST_CELLS = 64  # chosen: the largest number of cells along a receptor's side
MOST_PIXELS = 16  # chosen: the largest number of pixels along a cell's side


class ReferenceRenderer:
    """A renderer of one eye at a time: it traces an image on the tangent plane, and passes it to `optics.Eye.see`.

    Each receptor is divided into cells, which have the same ratio of height to width as the receptor. The methods raise
    the errors of `Mirror.render` for an invalid integrator, sampler, seed or `spp`.

    world, eyes: as in `sim.BatchedRenderer`
    integrator: Mitsuba's integrator: "path", "direct", or a description such as {"type": "path", "max_depth": 3}
    spp: samples per pixel of an image, 1 to 2³¹ - 1. A cell is one pixel if receptors are square, and several otherwise
    samples_per_receptor: cells along a receptor's side, 1 to 64; None: 1 for a perfect lens, 4 behind a pupil, and more
        for narrow rhabdoms
    depths: nearest and farthest distance [m]. Between them, the PSF depends on the distance of the visible surface.
        None: all light is blurred like light from infinity
    depth_layers: number of distances in `depths` for which a PSF is computed, 1 to 64, or "auto"
    sampler: Mitsuba's sampler: "independent", or "multijitter" for less noise
    variant: spectral variant of Mitsuba, such as "scalar_spectral", which runs without LLVM; None: the default of this
        machine
    seed: seed of the samples, 0 to 2¹²⁸; the attribute may be changed between images

    Warnings (`sim.MirrorWarning`) name lamps with spectral lines for which the eye has too few bands.

    Raises:
        ValueError: an argument is invalid, the world has a medium, the eyes are compound eyes, or the sides of a
            receptor are not in a ratio of whole numbers up to 16.
        optics.AccuracyError: the pupil spreads light too far for the PSF to be computed.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
        ImportError: Mitsuba lacks the variant, or cannot run it.
    """

    def __init__(
        self,
        world: World,
        eyes: Eyes,
        integrator: str | Mapping[str, Any] = "path",
        spp: int = 64,
        *,
        samples_per_receptor: int | None = None,
        depths: tuple[float, float] | None = None,
        depth_layers: int | str = "auto",
        sampler: str = "independent",
        variant: str | None = None,
        seed: int = 0,
    ) -> None:
        require_eyes_in_world(world, eyes)
        spp, seed = whole("spp", spp, 1, MOST_SAMPLES), whole("seed", seed, 0, MOST_SEED)
        if samples_per_receptor is not None:
            whole("samples_per_receptor", samples_per_receptor, 1, MOST_CELLS)
        if depths is not None and reals("depths", depths).shape != (2,):
            raise ValueError(f"depths = {shown(depths)}: must be the nearest and the farthest distance [m], or None")
        if world.medium is not None:
            raise ValueError("world: its medium must be None, the reference renders clear air only")
        eye = eyes.eye()
        if not isinstance(eye, optics.Eye):
            raise ValueError("eyes: their ommatidium must be None, the reference renders camera eyes only")
        self.world, self.eyes, self.eye = world, eyes, eye
        self.bands: optics.SpectralBands = self.eye.spectral_bands
        fewest = cells_for(self.eye) if self.eye.waveguide is not None else 4
        self.samples_per_receptor = samples_per_receptor or (1 if self.eye.pupil is None else fewest)
        self._pixels = _pixels_per_cell(self.eye.receptor_size)
        self._integrator, self._spp, self._sampler, self.seed = integrator, spp, sampler, seed
        self._has_depth = depths is not None
        z: Any = math.inf if depths is None else np.array(depths)
        sight = self.eye.sight(self.samples_per_receptor, z, depth_layers, light_from="centres")
        self.sight = replace(sight, parallax=0.0)  # rays only pass the middle of the pupil, where there is no parallax
        self._data = mujoco.MjData(world.model)
        spectra, off = lights_in_bands(world.model, world.spectra, self.eye.spectral_bands, self.eye.receptors)
        for words in off:
            warnings.warn(words, MirrorWarning, stacklevel=2)
        self._mirror = mirror(world.model, variant=variant, spectra=spectra)

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows and columns of cells (Y, X) of an image.

        Cells are the squares or rectangles into which the receptors are divided. The image covers the fields of all
        receptors.
        """
        sides = np.max([kernel.shape[1:] for kernel in self.sight.kernels.values()], axis=0)
        height, width = (
            n * self.samples_per_receptor + 2 * (int(side) // 2)
            for n, side in zip(self.eye.resolution, sides, strict=True)
        )
        return height, width

    def pictures(self, state: WorldState) -> np.ndarray:
        """Return the spectral radiance on the tangent plane, (env, eye, band, Y, X), in the unit of `Mirror.render`."""
        return np.array([[self._picture(view) for view in self._views(state, i)] for i in range(state.n)])

    def radiance(self, state: WorldState) -> np.ndarray:
        """Return the spectral radiance in each cell of the image of each eye, (env, eye, cell, band).

        The unit and the axes are the same as in the batched renderer's `radiance`, except that the third axis lists
        cells instead of rays. Cells are the squares or rectangles into which the receptors are divided. They are listed
        row by row.
        """
        pictures = self.pictures(state)
        return np.moveaxis(pictures.reshape(*pictures.shape[:3], -1), 2, 3)

    def signals(self, state: WorldState) -> np.ndarray:
        """Return noise-free photoreceptor signals, (env, eye, channel, height, width) float32."""
        return np.array([[self._signals(view) for view in self._views(state, i)] for i in range(state.n)])

    def _signals(self, view: Viewpoint) -> np.ndarray:
        z: Any = math.inf
        if self._has_depth:
            (height, width), (down, across) = self.shape, self._pixels
            fine = self._mirror.render_depth(view, width * across, height * down)
            z = fine[down // 2 :: down, across // 2 :: across]
        return np.asarray(
            self.eye.see(self._picture(view), self.samples_per_receptor, z=z, sight=self.sight), np.float32
        )

    def _picture(self, view: Viewpoint) -> np.ndarray:
        (height, width), (down, across) = self.shape, self._pixels
        size = width * across, height * down
        fine = self._mirror.render(
            view, *size, self._integrator, self._spp, self.bands.wavelengths, self.seed, self._sampler
        )
        return fine.reshape(-1, height, down, width, across).mean(axis=(2, 4))

    def _views(self, state: WorldState, index: int) -> list[Viewpoint]:
        """Return every eye's view of one world, after moving all bodies to their places in the state."""
        pose(self._data, self.world, state, index)
        self._mirror.sync(self._data)
        azimuths = self.eyes.azimuths()
        cos, sin = np.cos(state.heading[index]), np.sin(state.heading[index])
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        agent = np.array([*state.position[index], EYE_HEIGHT])
        half = self.shape[0] / 2 * self.eye.receptor_size[0] / self.samples_per_receptor
        fovy_deg = math.degrees(2 * math.atan(half / self.eye.sensor_distance))
        return [
            Viewpoint(agent + turn @ position, turn @ rotation, fovy_deg)
            for position, rotation in zip(eye_positions(azimuths), camera_rotations(azimuths), strict=True)
        ]


def _pixels_per_cell(receptor: tuple[float, float]) -> tuple[int, int]:
    """Return the numbers of rows and columns of square pixels in a cell.

    A receptor is divided into cells that have the same ratio of height to width as the receptor.

    receptor: height and width of a receptor

    Raises:
        ValueError: the ratio of the sides is not a ratio of whole numbers up to 16.
    """
    height, width = receptor
    ratio = Fraction(height / width).limit_denominator(MOST_PIXELS)
    if not math.isclose(ratio, height / width, rel_tol=1e-6) or ratio.numerator > MOST_PIXELS:
        raise ValueError(
            f"Eyes.vertical_fov_deg makes receptors {height / width:.6g} times as high as wide: for the reference "
            f"renderer, this must be a ratio of whole numbers up to {MOST_PIXELS}"
        )
    return ratio.numerator, ratio.denominator
