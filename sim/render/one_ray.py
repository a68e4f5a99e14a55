"""The simplest renderer: one world, one ray per receptor, a perfect lens, and direct light of lamps.

Read this file from top to bottom. `BatchedRenderer` computes the same for all worlds at once. It can also trace many
rays per receptor, and render eyes with pupils. A test compares this renderer with `BatchedRenderer`.
"""

from __future__ import annotations

import mitsuba as mi
import mujoco
import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.eyes import BODY_RADIUS, EYE_HEIGHT, Eyes
from sim.scene.mirror import mirror
from sim.scene.variant import MitsubaObject, variant
from sim.worlds.state import WorldState, pose
from sim.worlds.world import World


def see(world: World, eyes: Eyes, state: WorldState, index: int = 0) -> np.ndarray:
    """Return the noise-free signals of the eyes in one world, (eye, channel, height, width).

    Channels are the types of receptors. A pupil, a waveguide and a mosaic of receptors are ignored.

    state: state of one or more worlds
    index: index of the world in the state

    Raises:
        ValueError: the world has a medium, the receptors have a density, or the eyes are compound eyes.
    """
    if eyes.density is not None:
        raise ValueError("eyes: their density must be None, this renderer has receptors of one size only")
    if eyes.ommatidium is not None:
        raise ValueError("eyes: their ommatidium must be None, a single ray has no acceptance function")
    if world.medium is not None:
        raise ValueError("world: its medium must be None, a single ray renders clear air only")
    bands, data = eyes.eye().spectral_bands, mujoco.MjData(world.model)
    pose(data, world, state, index)  # moves all bodies to their places in the state
    scene = mirror(world.model, data, variant="scalar_spectral", spectra=world.spectra).scene
    signals = np.zeros((eyes.n_eyes, len(bands.weights), *eyes.resolution))
    with variant("scalar_spectral"):
        for eye, azimuth in enumerate(state.heading[index] + eyes.azimuths()):
            axis = np.array([np.cos(azimuth), np.sin(azimuth), 0])
            pupil = [*state.position[index], EYE_HEIGHT] + (BODY_RADIUS + 1e-5) * axis  # 10 µm off the skin
            for row, column in np.ndindex(*eyes.resolution):
                towards = receptor_direction(eyes, axis, row, column)
                ray = mi.Ray3f(mi.Point3f(pupil), mi.Vector3f(towards))
                signals[eye, :, row, column] = bands.weights @ radiance(scene, ray, 1e9 * bands.wavelengths)
    return signals


def receptor_direction(eyes: Eyes, axis: np.ndarray, row: int, column: int) -> np.ndarray:
    """Return the viewing direction of a receptor's centre, (3,); row 0 is at the top.

    axis: optical axis of the eye, a horizontal unit vector (3,)
    """
    height, width = eyes.resolution
    right, up = np.array([axis[1], -axis[0], 0]), np.array([0, 0, 1])
    across = np.tan(np.radians(eyes.fov_deg) / 2) * ((2 * column + 1) / width - 1)
    down = np.tan(np.radians(eyes.fovy_deg) / 2) * ((2 * row + 1) / height - 1)
    towards = axis + across * right - down * up
    return np.asarray(towards / np.linalg.norm(towards))


def radiance(scene: MitsubaObject, ray: Array, wavelengths_nm: np.ndarray) -> np.ndarray:
    """Return the radiance along a ray, ρ/π sum_l E_l cos θ_l over all unobstructed lamps l, (band,).

    ρ is the reflectance of the surface, E_l the irradiance from lamp l, and θ_l its angle of incidence. The radiance is
    0 if the ray hits no surface.

    wavelengths_nm: centres of the bands [nm], (band,)
    """
    hit, total = scene.ray_intersect(ray), np.zeros(len(wavelengths_nm))
    for b, wavelength in enumerate(wavelengths_nm if hit.is_valid() else ()):
        hit.wavelengths = mi.Spectrum(float(wavelength))
        for lamp in scene.emitters():
            sample, irradiance = lamp.sample_direction(hit, mi.Point2f(0.5))  # mi.Spectrum with equal entries
            if not scene.ray_test(hit.spawn_ray(sample.d)):
                total[b] += irradiance[0] * cosine(hit.n, sample.d)
        total[b] *= hit.bsdf().eval_diffuse_reflectance(hit)[0] / np.pi
    return total


def cosine(normal: Array, towards: Array) -> float:
    """Return the cosine of the angle between a normal and the direction towards a lamp, but at least 0."""
    return max(0.0, float(np.dot(np.ravel(normal), np.ravel(towards))))
