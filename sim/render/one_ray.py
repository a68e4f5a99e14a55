"""How eyes see, to be read from top to bottom: one world, one ray per receptor, a perfect lens, light straight from the
lamps. `BatchedRenderer` does this for all worlds at once, with many rays and behind pupils; a test compares them."""

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
    """Noise-free signals of one world of a state, (eye, channel, height, width)."""
    bands, data = eyes.eye().spectral_bands, mujoco.MjData(world.model)
    pose(data, world, state, index)  # everything goes where the state has it
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
    """Where a receptor's centre looks, a unit vector (3,), in an eye with this axis (3,); row 0 is on top."""
    height, width = eyes.resolution
    pitch = 2 * np.tan(np.radians(eyes.fov_deg) / 2) / width  # of receptors on a plane at distance 1
    right, up = np.array([axis[1], -axis[0], 0]), np.array([0, 0, 1])
    towards = axis + pitch * (column + 0.5 - width / 2) * right - pitch * (row + 0.5 - height / 2) * up
    return np.asarray(towards / np.linalg.norm(towards))


def radiance(scene: MitsubaObject, ray: Array, wavelengths_nm: np.ndarray) -> np.ndarray:
    """What comes along a ray: ρ/π sum_l E_l cos θ_l of the lamps that nothing hides, (band,)."""
    hit, total = scene.ray_intersect(ray), np.zeros(len(wavelengths_nm))
    for b, wavelength in enumerate(wavelengths_nm if hit.is_valid() else ()):
        hit.wavelengths = mi.Spectrum(float(wavelength))
        for lamp in scene.emitters():
            sample, irradiance = lamp.sample_direction(hit, mi.Point2f(0.5))  # mi.Spectrum: of equal entries here
            if not scene.ray_test(hit.spawn_ray(sample.d)):
                total[b] += irradiance[0] * cosine(hit.n, sample.d)
        total[b] *= hit.bsdf().eval_diffuse_reflectance(hit)[0] / np.pi
    return total


def cosine(normal: Array, towards: Array) -> float:
    """Lambert's: a surface turned away from a lamp gets nothing of its light."""
    return max(0.0, float(np.dot(np.ravel(normal), np.ravel(towards))))
