"""Axes of pupil and retina, against a small ray tracer in the space of the eye's owner: right, up, ahead.

The tracer has its own pupil, retina and order of receptors. It knows the axes of the OSA (ANSI Z80.28) only as "an
observer in front of the eye sees x to the right and y up".
"""

import math

import numpy as np
import pytest

import optics

RADIUS, CELLS, RECEPTORS = 40e-6, 2, 15
FOCAL = 200e-6 / (2 * math.tan(math.radians(30)))
LENS = {"aperture_radius": RADIUS, "thin_lens_focal_length": FOCAL}
WRONG = {
    "turned by 180°": lambda k: k[::-1, ::-1],
    "upside down": lambda k: k[::-1],
    "left and right exchanged": lambda k: k[:, ::-1],
    "rows and columns exchanged": lambda k: k.T,
}


def kernel_of(pupil, direction=(0.0, 0.0), **others):
    eye = optics.Eye(pupil, (RECEPTORS, RECEPTORS), 60.0, bands=1, receptors=(550,), **others)
    return eye.kernel(CELLS, direction_deg=direction)[0]


def traced(side, lead, light=lambda x, y: 1.0, direction=(0.0, 0.0), step=1e-8):
    """Return the light of a distant point in each cell around the receptor that looks at it, (down, right).

    lead(x, y): lead [m] of a wave that leaves the eye, with x and y as the observer sees them.
    light(x, y): transmitted intensity.
    direction: angles (right, up) [degrees] at which the owner sees the point.
    """
    at = (np.arange(500) + 0.5) / 500 * 2 * RADIUS - RADIUS
    right, up = (axis.ravel() for axis in np.meshgrid(at, at))
    right, up = (axis[np.hypot(right, up) < RADIUS] for axis in (right, up))

    def path(right, up):
        """Optical path of arriving light through lens and aberration. The path is shorter where leaving light leads."""
        return -(np.sqrt(right**2 + up**2 + FOCAL**2) - FOCAL) - lead(-right, up)

    slope_right = (path(right + step, up) - path(right - step, up)) / (2 * step)
    slope_up = (path(right, up + step) - path(right, up - step)) / (2 * step)
    to_point = np.array([math.tan(math.radians(direction[0])), math.tan(math.radians(direction[1])), 1.0])
    travels = -to_point / np.linalg.norm(to_point)
    go_right, go_up = travels[0] + slope_right, travels[1] + slope_up
    ahead = -np.sqrt(1 - go_right**2 - go_up**2)
    far = -FOCAL / ahead
    hit_right, hit_up = right + far * go_right, up + far * go_up
    # A receptor at (right, up) on the retina looks through the pupil's centre to the opposite side.
    seen_right, seen_up = -hit_right - FOCAL * to_point[0], -hit_up - FOCAL * to_point[1]
    cell = 200e-6 / RECEPTORS / CELLS
    edges = (np.arange(side + 1) - side / 2) * cell
    weight = light(-right, up) * np.ones(len(right))
    found, _, _ = np.histogram2d(-seen_up, seen_right, (edges, edges), weights=weight)
    return found / weight.sum()


def misfit(kernel, rays):
    """Relative distance of two kernels, each divided by its sum."""
    kernel, rays = kernel / kernel.sum(), rays / rays.sum()
    return np.linalg.norm(kernel - rays) / np.linalg.norm(rays)


def check(kernel, rays):
    """Rays neglect diffraction. Measured distances are 0.06 to 0.27, and 0.6 to 1.4 for wrong axes."""
    assert misfit(kernel, rays) < 0.3
    for name, turn in WRONG.items():
        assert misfit(turn(kernel), rays) > 0.5, name


def lead_of(modes):
    """Return the lead (x, y) -> W [m] as a sum of Zernike polynomials of the OSA; modes: coefficients [µm] by (n,
    m).
    """
    table = {
        (1, -1): lambda x, y: 2 * y,
        (1, 1): lambda x, y: 2 * x,
        (2, 0): lambda x, y: math.sqrt(3) * (2 * (x * x + y * y) - 1),
        (3, -3): lambda x, y: math.sqrt(8) * (3 * x * x * y - y**3),
        (3, -1): lambda x, y: math.sqrt(8) * (3 * (x * x + y * y) - 2) * y,
        (3, 1): lambda x, y: math.sqrt(8) * (3 * (x * x + y * y) - 2) * x,
        (3, 3): lambda x, y: math.sqrt(8) * (x**3 - 3 * x * y * y),
    }
    return lambda x, y: sum(1e-6 * c * table[mode](x / RADIUS, y / RADIUS) for mode, c in modes.items())


ODD = [(1, -1), (1, 1), (3, -3), (3, -1), (3, 1), (3, 3)]


@pytest.mark.parametrize("seed", range(3))
def test_odd_modes_of_an_aberrometer(seed):
    rng = np.random.default_rng(seed)
    modes = {(2, 0): 0.6} | {mode: float(c) for mode, c in zip(ODD, rng.uniform(-0.6, 0.6, 6), strict=True)}
    kernel = kernel_of(optics.Pupil(**LENS, wavefront=optics.Zernike(modes)))
    check(kernel, traced(len(kernel), lead_of(modes)))


def test_the_upper_half_of_a_myopic_pupil_blurs_upwards():
    """The half that an observer sees on top is open. Its rays cross the axis in front of the retina, hit it below the
    axis, and appear above. The image is shifted upwards by 2 receptors. If y pointed down, it would be shifted
    downwards.
    """
    upper = optics.difference(optics.Circle(), optics.Oblong(2.0, 1.0, (0.0, -0.5)))
    kernel = kernel_of(optics.Pupil(**LENS, aperture=upper, wavefront=optics.Zernike({(2, 0): 1.8})))
    middle = len(kernel) // 2
    assert kernel[: middle + 1].sum() > 0.95 * kernel.sum()
    up = (middle - np.arange(len(kernel))) @ kernel.sum(axis=1) / kernel.sum() / CELLS
    rays = traced(len(kernel), lead_of({(2, 0): 1.8}), lambda x, y: (y > 0) * 1.0)
    assert up == pytest.approx((middle - np.arange(len(rays))) @ rays.sum(axis=1) / rays.sum() / CELLS, rel=0.01)
    assert up == pytest.approx(2.0, abs=0.1)
    assert misfit(kernel, rays) < 0.3
    assert misfit(kernel[::-1], rays) > 1


def heights(x, y):
    return 12e-6 * (0.3 * x - 0.3 * y + 0.4 * x * x * y - 0.3 * y**3 + 0.25 * x**3 + 0.2 * x * x)


def samples(function, n=32):
    at = (np.arange(n) + 0.5) * 2 / n - 1
    return function(at[None, :], at[:, None])


def transmitted(x, y):
    """Intensity of a mask that is brighter at the bottom and at the observer's right."""
    return (0.5 + 0.2 * x / RADIUS - 0.3 * y / RADIUS) ** 2


TRIANGLE = [(-0.9, -0.3), (0.3, -0.9), (0.5, 0.8)]


def in_triangle(x, y):
    corners = [(RADIUS * a, RADIUS * b) for a, b in TRIANGLE]
    sides = zip(corners, corners[1:] + corners[:1], strict=True)
    return np.all([(b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) > 0 for a, b in sides], axis=0) * 1.0


SKEW = {(2, 0): 1.5, (3, -1): 0.3, (3, 3): 0.2}
PUPILS = {
    "relief": (
        optics.Pupil(**LENS, height=samples(heights), n=1.5),
        lambda x, y: -0.5 * heights(x / RADIUS, y / RADIUS),
        lambda x, y: 1.0,
    ),
    "wavefront map": (
        optics.Pupil(**LENS, wavefront=optics.WavefrontMap(samples(lambda x, y: -0.5 * heights(x, y)))),
        lambda x, y: -0.5 * heights(x / RADIUS, y / RADIUS),
        lambda x, y: 1.0,
    ),
    "mask": (
        optics.Pupil(
            **LENS,
            wavefront=optics.Zernike({(2, 0): 1.5}),
            mask=optics.MaskMap(samples(lambda x, y: 0.5 + 0.2 * x - 0.3 * y)),
        ),
        lead_of({(2, 0): 1.5}),
        transmitted,
    ),
    "polygon": (
        optics.Pupil(**LENS, wavefront=optics.Zernike(SKEW), aperture=optics.Polygon(TRIANGLE)),
        lead_of(SKEW),
        in_triangle,
    ),
}


@pytest.mark.parametrize("name", PUPILS)
def test_every_part_of_a_pupil_has_these_axes(name):
    pupil, lead, light = PUPILS[name]
    kernel = kernel_of(pupil)
    check(kernel, traced(len(kernel), lead, light))


@pytest.mark.parametrize("direction", [(12.0, 5.0), (-8.0, 11.0)])
def test_off_the_axis(direction):
    """The lens of the tracer is the phase of the pupil's lens, so that both have the same coma off the axis."""
    modes = {(2, 0): 0.6, (3, -1): 0.4, (3, 1): -0.4, (3, 3): -0.3}
    kernel = kernel_of(optics.Pupil(**LENS, wavefront=optics.Zernike(modes)), direction)
    check(kernel, traced(len(kernel), lead_of(modes), direction=direction))


def test_a_source_angle_is_a_direction_of_travel_in_these_axes():
    """A point at the owner's upper right is imaged at the owner's lower left: to the observer's right, and below."""
    pupil = optics.Pupil(**LENS)
    angle = math.radians(12.0), math.radians(-7.0)
    spot = optics.psf(pupil, [550e-9], FOCAL, source_angle=angle, dx=2e-6, shape=(65, 65))
    row, column = np.unravel_index(spot.psf[0].argmax(), spot.psf[0].shape)
    eye = optics.Eye(pupil, (RECEPTORS, RECEPTORS), 60.0, eccentricity_deg=(12.0, 7.0))
    assert np.hypot(spot.x[column] - eye.psf().centre[0], spot.y[row] - eye.psf().centre[1]) < 3e-6
    assert spot.x[column] > 0 > spot.y[row]


def test_signals_are_convolutions_with_the_traced_kernel():
    """A point of light is seen through the upper half of a myopic pupil, and the receptors above its image respond."""
    upper = optics.difference(optics.Circle(), optics.Oblong(2.0, 1.0, (0.0, -0.5)))
    pupil = optics.Pupil(**LENS, aperture=upper, wavefront=optics.Zernike({(2, 0): 1.5}))
    eye = optics.Eye(pupil, (RECEPTORS, RECEPTORS), 60.0, bands=1, receptors=(550,))
    scene = np.zeros((1, RECEPTORS * CELLS, RECEPTORS * CELLS))
    scene[0, 15:17, 15:17] = 1
    signals = eye.see(scene, CELLS)[0]
    assert signals[:7].sum() > 5 * signals[9:].sum()


@pytest.mark.parametrize("waveguide", [None, optics.Waveguide(5e-6)])
def test_turned_pupils_turn_the_kernel(waveguide):
    """The order of sums differs, and with it the last digits."""
    modes = {(2, 0): 0.3, (3, -1): 0.3, (3, 3): 0.2}
    pupil = optics.Pupil(**LENS, wavefront=optics.Zernike(modes))
    kernels = [kernel_of(pupil, (6.0, 3.0), pupil_turned=turned, waveguide=waveguide) for turned in (False, True)]
    other = kernel_of(pupil, (-6.0, -3.0), waveguide=waveguide)
    assert misfit(kernels[1], other[::-1, ::-1]) < 1e-5
    assert misfit(kernels[1], other) > 0.1


@pytest.mark.parametrize("waveguide", [None, optics.Waveguide(5e-6)])
@pytest.mark.parametrize("aperture", [optics.Circle(), optics.Annulus(0.5), optics.Slit(0.5, 1.5)])
def test_symmetric_pupils_see_the_same_either_way_to_the_last_bit(aperture, waveguide):
    relief = 4e-6 * np.random.default_rng(3).random((4, 4))
    relief = relief + relief[::-1]
    pupil = optics.Pupil(25e-6, optics.BSplineRelief(relief + relief[:, ::-1]), aperture=aperture)
    kernels = [kernel_of(pupil, pupil_turned=turned, waveguide=waveguide) for turned in (False, True)]
    assert np.array_equal(*kernels)


def test_a_perfect_lens_cannot_be_turned():
    with pytest.raises(ValueError, match="pupil_turned = True and pupil = None: must be False, or a Pupil"):
        optics.Eye(pupil_turned=True)
    with pytest.raises(ValueError, match="pupil_turned = 1: must be True or False"):
        optics.Eye(optics.Pupil(25e-6), pupil_turned=1)
