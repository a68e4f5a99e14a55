"""A ray trace, and the Huygens sum over its rays: lenses with the attributes of optiland's WavefrontData.

The Cooke triplet is that of optiland's samples: an entrance pupil 10 mm wide, and fields up to 20°.
"""

from types import SimpleNamespace

import numpy as np

# Radius [mm], thickness behind [mm], glass behind. The fourth surface is the stop.
TRIPLET = (
    (22.01359, 3.25896, "SK16"),
    (-435.76044, 6.00755, None),
    (-22.21328, 0.99997, "F2"),
    (20.29192, 4.75041, None),
    (79.68360, 2.95208, "SK16"),
    (-18.39533, 42.20778, None),
)
INDEX = {  # of SK16 (Hikari) and F2 (Schott)
    0.48e-6: {None: 1.0, "SK16": 1.62815120, "F2": 1.63309920},
    0.55e-6: {None: 1.0, "SK16": 1.62260856, "F2": 1.62365511},
    0.65e-6: {None: 1.0, "SK16": 1.61752422, "F2": 1.61542246},
}
ENTRANCE, EXIT = 11.512159, 50.961348  # [mm] entrance pupil behind the first surface, exit pupil before the image
LAST = sum(thickness for _, thickness, _ in TRIPLET)


def surface(points, away, radius, conic):
    """Return the points at which rays hit a conic surface through the origin, and the normals there."""
    c = 1 / radius
    (x, y, z), (l, m, n) = points, away
    a = c * (l * l + m * m + (1 + conic) * n * n)
    b = c * (x * l + y * m + (1 + conic) * z * n) - n
    d = c * (x * x + y * y + (1 + conic) * z * z) - 2 * z
    t = d / (-b + np.sqrt(b * b - a * d))
    met = points + t * away
    normal = np.stack([-c * met[0], -c * met[1], 1 - c * (1 + conic) * met[2]])
    return met, normal / np.linalg.norm(normal, axis=0), t


def refracted(away, normal, ratio):
    cosine = np.sum(normal * away, axis=0)
    return ratio * away + (np.sqrt(1 - ratio**2 * (1 - cosine**2)) - ratio * cosine) * normal


def hexapolar(rings):
    """Points of the unit disk: the centre, and 6k points on the k-th ring."""
    turns = np.concatenate([np.arange(6 * k) / (6 * k) for k in range(1, rings + 1)]) * 2 * np.pi
    r = np.concatenate([np.full(6 * k, k / rings) for k in range(1, rings + 1)])
    return np.insert(r * np.cos(turns), 0, 0.0), np.insert(r * np.sin(turns), 0, 0.0)


def triplet(angle_deg, wavelength, at=None, limit=None, normal=(0.0, 0.0, 1.0), shift=0.0):
    """The triplet's wavefront for light that comes from `angle_deg` below the axis.

    at: points of the entrance pupil, in radii, the chief ray first.
    limit: radius [mm] of the last surface; rays beyond it have no intensity.
    normal: normal of the image plane, which is turned about the image.
    shift: distance [mm] by which the image plane is moved.
    """
    x, y = hexapolar(12) if at is None else at
    angle, count = np.deg2rad(angle_deg), len(x)
    away = np.tile([[0.0], [np.sin(angle)], [np.cos(angle)]], (1, count))
    points = np.stack([5 * x, 5 * y, np.full(count, ENTRANCE)])
    path = np.sum(points * away, axis=0)  # from a plane of equal phase through the origin
    back = 20 / np.cos(angle)
    points, path, before, depth = points - back * away, path - back, 1.0, 0.0
    light = np.ones(count)
    for radius, thickness, glass in TRIPLET:
        index = INDEX[wavelength][glass]
        met, tilt, t = surface(points, away, radius, 0.0)
        path, away, before = path + before * t, refracted(away, tilt, before / index), index
        points, depth = met - np.array([[0], [0], [thickness]]), depth + thickness
    if limit is not None:
        light[np.hypot(met[0], met[1]) > limit] = 0.0
    normal = np.array(normal) / np.linalg.norm(normal)
    through = (points - points[2] / away[2] * away)[:, 0] + [0, 0, shift]
    t = normal @ (through[:, None] - points) / (normal @ away)
    centre = (points + t * away)[:, 0]
    sphere = np.linalg.norm(centre - [0, 0, -EXIT])
    offset = points - centre[:, None]
    along = np.sum(offset * away, axis=0)
    t = -along - np.sqrt(along**2 - np.sum(offset**2, axis=0) + sphere**2)
    met, path = points + t * away, path + t
    names = dict(zip(("pupil_x", "pupil_y", "pupil_z"), met, strict=True))
    opd = (path[0] - path) / (wavelength * 1e3)
    return SimpleNamespace(**names, opd=opd, intensity=light, radius=sphere, reference_center=centre)


def huygens(wave, wavelength, sensor, share=None):
    """Intensity at points of the sensor, (3, n) [m], as the sum of a spherical wave from each ray's point.

    share: amplitude of each ray. None: rays are spread evenly over the directions.
    """
    points = np.stack([wave.pupil_x, wave.pupil_y, wave.pupil_z]) * 1e-3
    amplitude = (np.asarray(wave.intensity) > 0).astype(float) if share is None else share
    k, found = 2 * np.pi / wavelength, []
    for part in np.array_split(sensor, max(1, sensor.shape[1] // 2048), axis=1):
        apart = np.linalg.norm(part[:, :, None] - points[:, None, :], axis=0) - wave.radius * 1e-3
        found.append(np.abs(np.exp(1j * k * (apart - wave.opd * wavelength)) @ amplitude) ** 2)
    return np.concatenate(found)


def sensor_grid(wave, n, pitch, normal=(0.0, 0.0, 1.0)):
    """Points (3, n²) [m] of a square grid on the image plane around the chief ray, row by row."""
    normal = np.array(normal) / np.linalg.norm(normal)
    right = np.array([1.0, 0, 0]) - normal[0] * normal
    right /= np.linalg.norm(right)
    up, at = np.cross(normal, right), (np.arange(n) - n // 2) * pitch
    y, x = (part.ravel() for part in np.meshgrid(at, at, indexing="ij"))
    return np.asarray(wave.reference_center)[:, None] * 1e-3 + right[:, None] * x + up[:, None] * y


def contrast(image, pitch, frequency, tangential=True):
    """Return |OTF| of an image at one frequency [1/m], along y (tangential) or along x, relative to the light in the
    image.
    """
    at = (np.arange(image.shape[0]) - image.shape[0] // 2) * pitch
    wave = np.exp(-2j * np.pi * frequency * at)
    return abs(np.sum(image * (wave[:, None] if tangential else wave))) / image.sum()


def gauss_rays(radii=24, turns=90):
    """Points of the unit disk, the centre first, and their weights in integrals over the disk."""
    s, weight = np.polynomial.legendre.leggauss(radii)
    r, angle = np.sqrt((s + 1) / 2), 2 * np.pi * np.arange(turns) / turns
    x, y = np.outer(r, np.cos(angle)).ravel(), np.outer(r, np.sin(angle)).ravel()
    return (np.insert(x, 0, 0.0), np.insert(y, 0, 0.0)), np.insert(np.repeat(weight, turns), 0, 0.0)


def grid_rays(n):
    """Points of the unit disk on a square grid with n points across, the centre first."""
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n)))
    inside = np.hypot(x, y) <= 1
    return np.insert(x[inside], 0, 0.0), np.insert(y[inside], 0, 0.0)


def solid_angles(at, wave, normal=(0.0, 0.0, 1.0)):
    """Return, for each point of the entrance pupil, the area of direction sines along the image plane per area of the
    pupil. It is the Jacobian of polynomials that are fitted to the sines of all rays.
    """
    normal = np.array(normal) / np.linalg.norm(normal)
    right = np.array([1.0, 0, 0]) - normal[0] * normal
    right /= np.linalg.norm(right)
    points = np.stack([wave.pupil_x, wave.pupil_y, wave.pupil_z]) - np.asarray(wave.reference_center)[:, None]
    sines = np.stack([right, np.cross(normal, right)]) @ points / wave.radius
    x, y = at
    powers = [(i, j) for i in range(8) for j in range(8 - i)]
    found = np.linalg.lstsq(np.stack([x**i * y**j for i, j in powers], axis=1), sines.T, rcond=None)[0]
    by_x = np.stack([i * x ** max(i - 1, 0) * y**j for i, j in powers], axis=1) @ found
    by_y = np.stack([j * x**i * y ** max(j - 1, 0) for i, j in powers], axis=1) @ found
    return np.abs(by_x[:, 0] * by_y[:, 1] - by_x[:, 1] * by_y[:, 0])
