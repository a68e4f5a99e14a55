"""Lenses exported by other programs, simulated by a ray tracer in this test: Navarro's eye."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import optics
from optics.elements.exit_pupil import read_exit_pupil
from optics.elements.wavefront import mode
from tests.optics.elements.traced_lens import refracted, surface

WAVE = 0.5876e-6
# Navarro, Santamaría & Bescós, JOSA A 2, 1273 (1985), relaxed: radius [mm], conic, thickness behind [mm], index behind.
NAVARRO = (
    (7.72, -0.26, 0.55, 1.3760),
    (6.5, 0.0, 3.05, 1.3374),
    (10.2, -3.1316, 4.0, 1.42),
    (-6.0, -1.0, 16.3203, 1.336),
)


def traced(image_shift=0.0, diameter=4.0, rings=12):
    """The contents of optiland's WavefrontData for the eye on its axis, with the image plane moved by `image_shift`
    [mm]."""
    turns = np.arange(1, 6 * rings * (rings + 1) // 2 + 1)
    r, angle = diameter / 2 * np.sqrt((turns - 0.5) / turns[-1]), turns * np.pi * (3 - np.sqrt(5))
    r, angle = np.append(r, np.full(64, diameter / 2)), np.append(angle, np.arange(64) / 64 * 2 * np.pi)
    r, angle = np.insert(r, 0, 0.0), np.insert(angle, 0, 0.0)  # the chief ray
    points = np.stack([r * np.cos(angle), r * np.sin(angle), np.full(len(r), -1.0)])
    away = np.tile([[0.0], [0.0], [1.0]], (1, len(r)))
    path, before, depth = np.zeros(len(r)), 1.0, 0.0
    for radius, conic, thickness, index in NAVARRO:
        met, normal, t = surface(points, away, radius, conic)
        path += before * t
        away = refracted(away, normal, before / index)
        points, before, depth = met - np.array([[0], [0], [thickness]]), index, depth + thickness
    centre = np.array([0.0, 0.0, image_shift])
    sphere = 15.0 + image_shift
    offset = points - centre[:, None]
    along = np.sum(offset * away, axis=0)
    t = -along - np.sqrt(along**2 - np.sum(offset**2, axis=0) + sphere**2)  # back from the image, in front of it
    met, path = points + t * away, path + before * t
    names = dict(zip(("pupil_x", "pupil_y", "pupil_z"), met, strict=True))
    return SimpleNamespace(
        **names, opd=(path[0] - path) / (WAVE * 1e3), intensity=np.ones(len(r)), radius=sphere, reference_center=centre
    )


def rays_at(x, y, ahead):
    """Rays at points (x, y) [m] of a plane 0.1 m in front of the image, with the wavefront [m] there."""
    z, sphere = np.full(np.shape(x), -0.1), 100.0
    points = np.stack([x, y, z]) * sphere / np.linalg.norm(np.stack([x, y, z]), axis=0)
    names = dict(zip(("pupil_x", "pupil_y", "pupil_z"), points, strict=True))
    return SimpleNamespace(**names, opd=ahead / WAVE, radius=sphere, reference_center=(0.0, 0.0, 0.0))


def axis(pupil, z):
    seen = optics.psf(pupil, [WAVE], z, dx=0.2e-6, shape=(3, 3), tolerance=1e-5, dtype="float64")
    return float(seen.psf[0, 1, 1])


def strehl(read):
    without = optics.Pupil(read.pupil.radius, medium_n=1.336, thin_lens_focal_length=read.distance)
    return axis(read.pupil, read.distance) / axis(without, read.distance)


def test_navarro_s_eye_is_as_sharp_as_its_rays_say():
    """The Strehl ratio on the axis is compared with |mean of e^{2πiW}|² over rays that are evenly spaced in the
    entrance pupil. optiland 0.6.3 gives a root mean square of 0.0784 waves and a peak of 0.780, from samples that do
    not reach the rim.
    """
    system = traced()
    read = read_exit_pupil(system, WAVE, medium_n=1.336)
    rays = np.abs(np.mean(np.exp(2j * np.pi * system.opd[:-64]))) ** 2
    assert strehl(read) == pytest.approx(rays, abs=0.01)
    assert read.rms / WAVE == pytest.approx(0.0784, abs=0.003)
    assert read.residual < 1e-4 * WAVE
    seen = optics.psf(read.pupil, [WAVE], read.distance, dx=0.4e-6, shape=(65, 65), tolerance=1e-4)
    assert optics.strehl_ratio(seen)[0] == pytest.approx(0.780, abs=0.01)


def test_the_wave_is_ahead_where_the_other_program_says():
    """The image 0.1 mm further back is the same whether the exit pupil is read for this plane or the sensor is moved
    there. A wavefront of the opposite sign gives another image.
    """
    here, behind = (read_exit_pupil(traced(shift), WAVE, medium_n=1.336) for shift in (0.0, 0.1))
    there = axis(behind.pupil, behind.distance)
    assert axis(here.pupil, here.distance + 0.1e-3) == pytest.approx(there, rel=0.03)
    assert axis(here.pupil, here.distance - 0.1e-3) != pytest.approx(there, rel=0.3)
    turned = traced(0.1)
    turned.opd = -turned.opd
    wrong = read_exit_pupil(turned, WAVE, medium_n=1.336)
    assert axis(wrong.pupil, wrong.distance - 0.1e-3) != pytest.approx(axis(here.pupil, here.distance), rel=0.1)


def test_the_sphere_s_centre_is_found_where_nobody_says():
    system = traced()
    system.reference_center = None
    read, known = read_exit_pupil(system, WAVE, medium_n=1.336), read_exit_pupil(traced(), WAVE, medium_n=1.336)
    assert read.pupil.radius == pytest.approx(known.pupil.radius, rel=1e-6)


def wavefront(n=64, waves=0.7, pitch=0.05):
    """A wavefront in prysm's form: a round opening, with several turns of astigmatism and coma."""
    x = (np.arange(n) - n // 2) * pitch / (n // 2 * pitch * 0.9)
    inside = x[None, :] ** 2 + x[:, None] ** 2 <= 1
    phase = 2 * np.pi * waves * (mode(2, 2, x[None, :], x[:, None]) + 0.3 * mode(3, 1, x[None, :], x[:, None]))
    return SimpleNamespace(data=inside * np.exp(1j * phase), dx=pitch, wavelength=WAVE * 1e6)


def test_samples_of_a_phase_are_read_without_its_jumps():
    read = read_exit_pupil(wavefront(), WAVE, focal_length=0.1)
    found = read.pupil.wavefront.modes
    scale = 0.9 * 32 * 0.05e-3 / read.pupil.radius  # the outermost samples lie within the opening
    assert found[2, 2] == pytest.approx(-0.7 * WAVE * 1e6 / scale**2, rel=0.02)
    assert found[3, 1] == pytest.approx(-0.21 * WAVE * 1e6 / scale**3, rel=0.03)
    assert read.residual < 1e-3 * WAVE


def round_samples(n, width, centre, soft):
    """A quarter of a micrometre of spherical aberration in a pupil of 4 mm, on n x n samples over `width` [mm]; sample
    n//2 is at 0 (prysm's make_xy_grid).

    centre: centre of the pupil in samples. soft: the samples at the rim have the share of their width that is covered.
    """
    pitch = width / n
    at = (np.arange(n) - n // 2) * pitch
    rho = np.hypot(at[None, :] - centre[0] * pitch, at[:, None] - centre[1] * pitch) / 2
    inside = np.clip((1 - rho) * 2 / pitch + 0.5, 0, 1) if soft else rho <= 1
    phase = 2 * np.pi * 0.25 / 0.555 * (6 * rho**4 - 6 * rho**2 + 1)
    return SimpleNamespace(data=inside * np.exp(1j * phase), dx=pitch, wavelength=0.555)


def test_one_sample_on_the_rim_of_an_even_grid_decides_nothing():
    """256 samples over 4 mm reach from -2 mm to 1.98 mm. The radius is 2 mm, the root mean square 0.25 µm/√5, and the
    Strehl ratio |∫ exp(2πiW/λ) dρ²|². The tolerances admit the pitch of the samples, 0.8 % of the radius, to its
    square. If the radius were half a sample too long, the Strehl ratio would be 0.165.
    """
    rho2 = (np.arange(4000) + 0.5) / 4000
    ratio = abs(np.mean(np.exp(2j * np.pi * 0.25 / 0.555 * (6 * rho2**2 - 6 * rho2)))) ** 2
    read = read_exit_pupil(round_samples(256, 4.0, (0, 0), soft=False), 0.555e-6, focal_length=0.1)
    assert read.pupil.radius == pytest.approx(2e-3, rel=1e-4)
    assert read.rms == pytest.approx(0.25e-6 / math.sqrt(5), rel=1e-3)
    seen = optics.psf(read.pupil, [0.555e-6], read.distance, dx=2e-6, shape=(33, 33))
    assert optics.strehl_ratio(seen)[0] == pytest.approx(ratio, rel=3e-3)


def test_circles_are_found_to_a_tenth_of_a_sample():
    """Numbers of samples, widths of the grid, subsamples of the centre and the rim are random. Boxes around the samples
    are wrong by up to a whole sample. An offset of 0.1 sample tilts the wavefront of W = 6ρ⁴ - 6ρ² by less than 1 %."""
    rng = np.random.default_rng(8)
    for case in range(40):
        n, soft, width = int(rng.integers(60, 257)), bool(case % 2), 4 * rng.uniform(1.05, 1.4)
        system = round_samples(n, width, rng.uniform(-0.5, 0.5, 2), soft)
        read = read_exit_pupil(system, 0.555e-6, focal_length=0.1, order=4)
        assert abs(read.pupil.radius * 1e3 - 2) < 0.1 * system.dx, (n, soft, width)
        assert math.hypot(*(read.pupil.wavefront.modes[1, m] for m in (-1, 1))) < 0.0025, (n, soft, width)


@pytest.mark.parametrize("around", [9, 11, 15])
def test_rings_with_an_odd_number_of_rays_have_their_middle(around):
    """A box around such a ring is not centred on it: with nine rays, the box's middle is 3 % of the radius off."""
    rays = [(0.0, 0.0)] + [
        (k / 4 * math.cos(turn) + 0.3, k / 4 * math.sin(turn) - 0.2)
        for k in range(1, 5) for turn in np.arange(around) * 2 * math.pi / around
    ]  # fmt: skip
    x, y = np.array(rays).T * 1e-3
    ahead = 1e-7 * (((x - 0.3e-3) ** 2 + (y + 0.2e-3) ** 2) / 1e-6)
    read = read_exit_pupil(rays_at(x, y, ahead), WAVE, order=2)
    assert read.pupil.radius == pytest.approx(1e-3, rel=1e-4)
    assert read.pupil.wavefront.modes[1, 1] == pytest.approx(0, abs=1e-5)


def test_coarse_squares_and_lines_are_refused():
    whole = changed(wavefront(), data=np.ones((64, 64), complex))
    with pytest.raises(ValueError, match=r"4096 samples are 0\.022 radii apart: must be at most 0\.02 radii"):
        read_exit_pupil(whole, WAVE, focal_length=0.1)
    line = np.linspace(-1e-3, 1e-3, 50)
    with pytest.raises(ValueError, match="the samples of the pupil lie on a line"):
        read_exit_pupil(rays_at(line, line, 0 * line), WAVE, order=1)


def changed(system, **others):
    return SimpleNamespace(**(vars(system) | others))


FOCUSED = {"focal_length": 0.1}


@pytest.mark.parametrize(
    ("system", "more", "says"),
    [
        (object(), {}, "must have pupil_x"),
        (wavefront(), {}, "focal_length is missing"),
        (wavefront(), {"focal_length": 0.1, "wavelength": 0.5e-6}, "the object's is 0.5876"),
        (wavefront(), {"focal_length": 0.1, "order": 0}, "order"),
        (wavefront(n=12), {"focal_length": 0.1}, "samples of the wavefront"),
        (changed(wavefront(), data=np.zeros((9, 9), complex)), FOCUSED, "data is dark everywhere: must hold"),
        (changed(wavefront(), data=np.zeros((0, 9))), FOCUSED, r"data has shape \(0, 9\): must be a plane"),
        (changed(wavefront(), data="glass"), FOCUSED, "data: must be numbers, not 'glass'"),
        (changed(wavefront(), dx=None), FOCUSED, "dx = None: must be a finite number"),
        (changed(wavefront(), dx=0.0), FOCUSED, "dx = 0.0: must be a finite number"),
        (changed(wavefront(), dx=-0.1), FOCUSED, "dx = -0.1: must be greater than 0"),
        (changed(wavefront(), wavelength=None), FOCUSED, "wavelength = None: must be a finite number"),
        (changed(traced(), pupil_y=np.ones(3)), {}, "pupil_y has 3 numbers: must have one for each ray, 533 as"),
        (changed(traced(), opd=np.ones(3)), {}, "opd has 3 numbers: must have one for each ray"),
        (changed(traced(), intensity=np.ones(3)), {}, "intensity has 3 numbers: must have one for each ray"),
        (changed(traced(), intensity=0 * traced().opd), {}, "intensity: no ray has positive intensity"),
        (changed(traced(), opd=math.nan * traced().opd), {}, "no ray has positive intensity and finite position"),
        (changed(traced(), opd="glass"), {}, "opd = 'glass': must be real numbers"),
        (changed(traced(), radius=None), {}, "radius = None: must be a finite number"),
        (changed(traced(), reference_center=(0.0, 0.0)), {}, r"reference_center = \(0.0, 0.0\): must be three"),
    ],
)
def test_what_cannot_be_read_is_said_in_a_line(system, more, says):
    with pytest.raises(ValueError, match=says) as error:
        read_exit_pupil(system, **{"wavelength": WAVE, **more})
    assert "\n" not in str(error.value)


def test_obscured_and_uneven_pupils_are_refused():
    """The rims of these pupils are round. If they were read as open circles, they would silently become other
    lenses.
    """
    at = (np.arange(64) - 32) / (32 * 0.9)
    r = np.hypot(at[None, :], at[:, None])
    for amplitude in (r > 0.5, np.exp(-(r**2)), r > 0.1):
        system = wavefront()
        system.data = system.data * amplitude
        with pytest.raises(ValueError, match="obscured, not convex, or unevenly lit: only unobscured pupils"):
            read_exit_pupil(system, WAVE, focal_length=0.1, order=2)
    system = traced()
    off = np.hypot(system.pupil_x, system.pupil_y)
    kept = off > 0.5 * off.max()
    for name in ("pupil_x", "pupil_y", "pupil_z", "opd", "intensity"):
        setattr(system, name, getattr(system, name)[kept])
    with pytest.raises(ValueError, match="the pupil is obscured"):
        read_exit_pupil(system, WAVE, order=2)


@pytest.mark.parametrize("rings", [2, 3, 4, 5, 9])
def test_few_rings_of_rays_are_no_obscured_pupil(rings):
    """The k-th ring of a hexapolar grid has 6k rays. If the inner half of the rings is missing, the pupil is
    obscured.
    """
    rays = [(0.0, 0.0)] + [
        (k / rings * math.cos(turn), k / rings * math.sin(turn))
        for k in range(1, rings + 1) for turn in np.arange(6 * k) * math.pi / (3 * k)
    ]  # fmt: skip
    x, y = np.array(rays).T * 1e-3
    assert read_exit_pupil(rays_at(x, y, 0 * x), WAVE, order=1).pupil.radius == pytest.approx(1e-3)
    outer = np.hypot(x, y) > 0.5e-3
    with pytest.raises(ValueError, match="obscured"):
        read_exit_pupil(rays_at(x[outer], y[outer], 0 * x[outer]), WAVE, order=1)
