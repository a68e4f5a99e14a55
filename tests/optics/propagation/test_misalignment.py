"""Decentred and tilted pupils against integrals over tilted planes, and symmetries."""

import math

import numpy as np
import pytest

import optics
from optics import FreeSpace, Misaligned, Pupil, propagate_through
from validation.reference import relative_l2

WAVELENGTH = 500e-9
K = 2 * np.pi / WAVELENGTH
APERTURE, GAP, RADIUS, FOCAL_LENGTH = 60e-6, 1.2e-3, 60e-6, 1e-3
WINDOW = {"wavelength": WAVELENGTH, "out_dx": 2e-6, "out_shape": (15, 15)}


def kernel_sum(amplitudes, at, normal, targets):
    """Return the first Rayleigh-Sommerfeld integral over nodes in a plane with this normal, at targets (n, 3)."""
    found = []
    for some in np.array_split(targets, max(1, len(targets) // 300)):
        offset = some[:, None] - at[None]
        path = np.sqrt((offset**2).sum(axis=-1))
        kernel = offset @ normal / (2 * np.pi * path**2) * (1 / path - 1j * K) * np.exp(1j * K * path)
        found.append(kernel @ amplitudes)
    return np.concatenate(found)


def tilted_disk(x, y, tilt):
    """Return the normal of a tilted plane, and the points (n, 3) with the coordinates x and y in the plane."""
    slope = np.tan(tilt)
    steep, cosine = np.hypot(*slope), 1 / np.hypot(1, np.hypot(*slope))
    normal = np.array([-slope[0], -slope[1], 1]) * cosine
    towards = slope / steep if steep else np.zeros(2)
    shorter = (x * towards[0] + y * towards[1]) * (cosine - 1)
    x, y = x + shorter * towards[0], y + shorter * towards[1]
    return normal, np.stack([x, y, slope[0] * x + slope[1] * y], axis=-1)


def exact(decentre, tilt):
    """Return the field behind an aperture and a misaligned lens, by one integral over each of their planes."""
    nodes = optics.Circle().nodes(16.0, 5.0)
    first = APERTURE * np.stack([nodes.x, nodes.y, 0 * nodes.x], axis=-1)
    x, y = RADIUS * nodes.x, RADIUS * nodes.y
    normal, second = tilted_disk(x, y, tilt)
    second += np.array([*decentre, GAP])
    arriving = kernel_sum(nodes.weight * APERTURE**2, first, np.array([0, 0, 1.0]), second)
    r2 = x**2 + y**2
    lens = np.exp(-1j * K * r2 / (np.sqrt(r2 + FOCAL_LENGTH**2) + FOCAL_LENGTH))
    at = (np.arange(15) - 7) * 2e-6
    window = np.stack([*(a.ravel() for a in np.meshgrid(at, at)), np.full(225, GAP + FOCAL_LENGTH)], axis=-1)
    return kernel_sum(arriving * lens * nodes.weight * RADIUS**2, second, normal, window).reshape(15, 15)


def system(decentre, tilt):
    lens = Misaligned(Pupil(RADIUS, thin_lens_focal_length=FOCAL_LENGTH), decentre, tilt)
    return [Pupil(APERTURE), FreeSpace(GAP), lens, FreeSpace(FOCAL_LENGTH)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("decentre", "tilt", "tolerances"),
    [
        ((5e-6, -3e-6), (0.0, 0.0), (1e-2, 1e-5)),
        ((0.0, 0.0), (0.02, 0.0), (1e-2, 1e-3)),
        ((5e-6, -3e-6), (0.1, 0.05), (1e-2,)),
    ],
)
def test_integrals_over_planes_in_space_are_met(decentre, tilt, tolerances):
    expected = exact(decentre, tilt)
    for tolerance in tolerances:
        out = propagate_through(system(decentre, tilt), **WINDOW, tolerance=tolerance, dtype="float64")
        assert relative_l2(np.abs(out.u) ** 2, np.abs(expected) ** 2) < out.predicted_error < tolerance
        assert np.linalg.norm(out.u - expected) < tolerance * np.linalg.norm(expected)
    # The comparison rejects the opposite misalignment, and none.
    for sign in (-1, 0):
        other = system(tuple(sign * d for d in decentre), tuple(sign * t for t in tilt))
        wrong = propagate_through(other, **WINDOW, tolerance=1e-2)
        assert relative_l2(np.abs(wrong.u) ** 2, np.abs(expected) ** 2) > 4e-3


def test_an_empty_tilted_pupil_changes_only_what_its_foreshortening_blocks():
    """The field is propagated to the tilted plane, and from there to the output plane. Far inside the rim, the pupil
    has no effect.
    """
    x = (np.arange(65) - 32) * 4e-6
    u = np.exp(-np.add.outer((x - 6e-6) ** 2, (x + 8e-6) ** 2) / (24e-6) ** 2 + 0.1e6j * np.add.outer(x, -x))
    settings = {"dx": 4e-6, "wavelength": WAVELENGTH, "tolerance": 1e-3, "dtype": "float64"}
    plain = propagate_through([FreeSpace(4e-3)], u, **settings)
    through = [FreeSpace(2e-3), Misaligned(Pupil(0.14e-3), (8e-6, 0.0), (0.015, -0.01)), FreeSpace(2e-3)]
    tilted = propagate_through(through, u, **settings)
    assert np.linalg.norm(tilted.u - plain.u) < 1e-4 * np.linalg.norm(plain.u)
    back = propagate_through(through, plain.u, **settings, backward=True)
    there = propagate_through([FreeSpace(4e-3)], plain.u, **settings, backward=True)
    assert np.linalg.norm(back.u - there.u) < 1e-4 * np.linalg.norm(there.u)


@pytest.mark.parametrize("distance", [math.inf, 20e-3])
def test_a_decentred_lens_moves_the_image(distance):
    """A lens that is decentred by d moves the image by d f⁻¹ / (f⁻¹ - s⁻¹), which is d for a source at infinity."""
    lens, source = Pupil(0.15e-3, thin_lens_focal_length=5e-3), optics.PointSource(distance, (0.002, 0.0))
    z, dx, decentre = 1 / (1 / 5e-3 - 1 / distance), 2e-6, np.array([12e-6, -6e-6])
    moved = decentre * z / 5e-3
    where = {"wavelength": WAVELENGTH, "out_dx": dx, "out_shape": (41, 41), "source": source}
    images = [
        np.abs(propagate_through([Misaligned(lens, tuple(at)), FreeSpace(z)], **where).u) ** 2
        for at in (np.zeros(2), decentre)
    ]
    x = (np.arange(41) - 20) * dx
    centres = [np.array([(core.sum(0) * x).sum(), (core.sum(1) * x).sum()]) / core.sum() for core in np.square(images)]
    np.testing.assert_allclose(centres[1] - centres[0], moved, rtol=0.01)
    plain = propagate_through([lens, FreeSpace(z)], **where)
    np.testing.assert_allclose(np.abs(plain.u) ** 2, images[0], atol=1e-5 * images[0].max())


def test_light_from_a_tilted_source_equals_a_tilted_system():
    """For a plane wave along the axis of a tilted lens, the lens is aligned, and the focus lies on its axis."""
    angle, f = 0.03, 2e-3
    lens = Pupil(80e-6, thin_lens_focal_length=f)
    tilted = [Misaligned(lens, (0.0, 0.0), (-angle, 0.0)), FreeSpace(f * math.cos(angle))]
    source = optics.PointSource(angle=(angle, 0.0))
    where = {"wavelength": WAVELENGTH, "out_dx": 2e-6, "source": source, "tolerance": 1e-3}
    seen = np.abs(propagate_through(tilted, **where, out_shape=(31, 91)).u) ** 2
    at = (np.arange(91) - 45) * 2e-6
    centre = (seen.sum(axis=0) * at).sum() / seen.sum()
    assert centre == pytest.approx(f * math.sin(angle), abs=0.3e-6)
    aligned = propagate_through([lens, FreeSpace(f)], wavelength=WAVELENGTH, out_dx=2e-6, out_shape=(31, 31))
    assert seen.max() == pytest.approx((np.abs(aligned.u) ** 2).max(), rel=2e-3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((Pupil(1e-4), (1e-6,)), "decentre = .*two lengths"),
        ((Pupil(1e-4), (0.0, 0.0), (0.5, 0.0)), r"tilt = 0\.5: must lie in"),
        ((FreeSpace(1e-3),), "pupil = "),
    ],
)
def test_bad_arguments_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        Misaligned(*arguments)
