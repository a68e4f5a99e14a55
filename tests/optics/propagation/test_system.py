"""Systems of pupils and free space against exact integrals, identities and a relay's image."""

import numpy as np
import pytest

import optics
from optics import BSplineRelief, FreeSpace, Pupil, propagate_through
from validation import reference
from validation.reference import order_of_convergence, relative_l2

WAVELENGTH, DX, N = 500e-9, 0.5e-6, 65
X, Y = np.meshgrid(*[(np.arange(N) - N // 2) * DX] * 2)


def spot(x, y, waist):
    return np.exp(-((X - x) ** 2 + (Y - y) ** 2) / waist**2)


# An object that is not symmetric, and smooth to 1e-11 at the rim of its window.
OBJECT = (spot(2e-6, 0, 2.5e-6) + 0.6j * spot(0, -3e-6, 2.5e-6)).astype(complex)
SETTINGS = {"wavelength": WAVELENGTH, "dx": DX, "dtype": "float64", "tolerance": 1e-6}


def field_error(u, expected):
    return np.linalg.norm(u - expected) / np.linalg.norm(expected)


PUPILS = {
    "aperture": (Pupil(20e-6), 200e-6),
    "lens": (Pupil(20e-6, thin_lens_focal_length=200e-6), 200e-6),
    "relief": (Pupil(12e-6, BSplineRelief(4e-6 * np.random.default_rng(0).random((4, 4)))), 100e-6),
    "slit in water": (Pupil(20e-6, aperture=optics.Slit(1.0, 0.7), medium_n=1.33), 150e-6),
}


@pytest.mark.fast_cases(4)
@pytest.mark.parametrize(("dtype", "tolerance"), [("float32", 1e-3), ("float64", 1e-7)])
@pytest.mark.parametrize("name", PUPILS)
def test_a_pupil_and_free_space_are_psf(name, dtype, tolerance):
    pupil, z = PUPILS[name]
    source = optics.PointSource(1e-3, (0.05, -0.02))
    out = propagate_through(
        [pupil, FreeSpace(z, pupil.medium_n)],
        wavelength=WAVELENGTH,
        source=source,
        out_dx=1.5e-6,
        out_shape=(31, 27),
        dtype=dtype,
        tolerance=tolerance,
    )
    exact = optics.psf(
        pupil, [WAVELENGTH], z, source.distance, source.angle, dx=1.5e-6, shape=(31, 27), tolerance=1e-9,
        method="rayleigh_sommerfeld", dtype="float64",
    )  # fmt: skip
    assert relative_l2(np.abs(out.u) ** 2 / pupil.area, exact.psf[0]) < out.predicted_error < tolerance


def test_two_apertures_converge_spectrally_to_two_exact_integrals():
    """Each requested digit is obtained behind two hard edges. The reference is the Rayleigh-Sommerfeld integral of the
    field on the second aperture.
    """
    (a, z), (b, y) = (10e-6, 60e-6), (8e-6, 50e-6)
    nodes = optics.Circle().nodes(30.0, 9.0)
    at_nodes = reference.ideal_lens_profile(b, WAVELENGTH, a, distance=z)(b * np.hypot(nodes.x, nodes.y))
    x, k = (np.arange(21) - 10) * 0.8e-6, 2 * np.pi / WAVELENGTH
    distance = np.sqrt((x[:, None] - b * nodes.x) ** 2 + (b * nodes.y) ** 2 + y**2)
    kernel = y / (2 * np.pi * distance**2) * (1 / distance - 1j * k) * np.exp(1j * k * (distance + z))
    exact = kernel @ (at_nodes * nodes.weight * b**2)
    for tolerance in (1e-2, 1e-4, 1e-6):
        out = propagate_through(
            [Pupil(a), FreeSpace(z), Pupil(b), FreeSpace(y)], wavelength=WAVELENGTH, out_dx=0.8e-6, out_shape=(21, 21),
            dtype="float64", tolerance=tolerance,
        )  # fmt: skip
        assert field_error(out.u[10], exact) < out.predicted_error < tolerance
        assert out.steps[0].power_out < out.steps[0].power_in


def test_two_halves_are_a_whole():
    """Adjacent free spaces are combined. A wide open pupil between the halves makes them separate."""
    whole = propagate_through([FreeSpace(200e-6)], OBJECT, **SETTINGS)
    half = propagate_through([FreeSpace(100e-6), Pupil(40e-6), FreeSpace(100e-6)], OBJECT, **SETTINGS)
    assert len(half.steps) == 2
    assert field_error(half.u, whole.u) < half.predicted_error + whole.predicted_error
    narrow = propagate_through([FreeSpace(100e-6), Pupil(6e-6), FreeSpace(100e-6)], OBJECT, **SETTINGS)
    assert field_error(narrow.u, whole.u) > 1e-3  # the comparison can fail
    added = propagate_through([FreeSpace(60e-6), FreeSpace(140e-6)], OBJECT, **SETTINGS)
    assert field_error(added.u, whole.u) < 1e-12


@pytest.mark.slow
def test_a_relief_of_the_mediums_index_changes_nothing():
    relief = 10e-6 * np.random.default_rng(1).random((8, 8))
    through = [
        propagate_through([FreeSpace(99e-6, 1.33), pupil, FreeSpace(99e-6, 1.33)], OBJECT, **SETTINGS).u
        for pupil in (Pupil(20e-6, relief, n=1.33, medium_n=1.33), Pupil(20e-6, medium_n=1.33))
    ]
    np.testing.assert_array_equal(*through)
    bent = propagate_through(
        [FreeSpace(99e-6, 1.33), Pupil(20e-6, relief, n=1.4, medium_n=1.33), FreeSpace(99e-6, 1.33)],
        OBJECT,
        **SETTINGS | {"tolerance": 1e-3},
    )
    assert field_error(bent.u, through[0]) > 0.1


def test_a_relay_of_two_lenses_inverts_its_object():
    """A relay of length 4f gives -u(-x) e^{4ikf} in paraxial theory, with the sign of (1/iλf)². Rays from x at the
    angle θ deviate by a phase of order k x² θ²/f.
    """
    focal_lengths, errors = np.array([75e-6, 150e-6]), []
    for f in focal_lengths:
        lens = Pupil(0.3 * f, thin_lens_focal_length=f)
        relay = [FreeSpace(f), lens, FreeSpace(2 * f), lens, FreeSpace(f)]
        out = propagate_through(relay, OBJECT, wavelength=WAVELENGTH, dx=DX)
        expected = -OBJECT[::-1, ::-1] * np.exp(2j * np.pi * 4 * f / WAVELENGTH)
        errors.append(field_error(out.u, expected))
        assert relative_l2(np.abs(out.u) ** 2, np.abs(OBJECT) ** 2) > 0.5  # not upright
    assert errors[-1] < 0.01
    assert order_of_convergence(focal_lengths, errors) == pytest.approx(-1, abs=0.1)


def test_backwards_undoes_forwards():
    system = [FreeSpace(120e-6), Pupil(30e-6, thin_lens_focal_length=100e-6), FreeSpace(120e-6)]
    there = propagate_through(system, OBJECT, **SETTINGS, out_shape=(97, 97))
    back = propagate_through(system, there.u, **SETTINGS, out_shape=(N, N), backward=True)
    assert field_error(back.u, OBJECT) < 1e-5  # the lens spreads 4e-6 of the light beyond the wide window
    assert [step.distance for step in back.steps] == [-120e-6, -120e-6]


def test_what_decays_does_not_come_back():
    """The field is g (1 + cos 2πfx) with f = 1.5/λ. Its two orders of amplitude 1/2, with 1/3 of the power, are
    evanescent, and vanish within 2 µm.
    """
    n, dx = 128, 0.1e-6
    x = (np.arange(n) - n // 2) * dx
    smooth = np.exp(-(x[None, :] ** 2 + x[:, None] ** 2) / (1.2e-6) ** 2)
    u = smooth * (1 + np.cos(2 * np.pi * 1.5 / WAVELENGTH * x)[None, :])
    settings = {"wavelength": WAVELENGTH, "dx": dx, "tolerance": 1e-2}
    there = propagate_through([FreeSpace(2e-6)], u, **settings, out_shape=(256, 256))
    assert there.steps[0].evanescent_power == pytest.approx(1 / 3, abs=1e-3)
    back = propagate_through([FreeSpace(2e-6)], there.u, **settings, out_shape=(n, n), backward=True)
    assert field_error(back.u, smooth) < 0.01
    assert field_error(back.u, u) > 0.5


@pytest.mark.parametrize(
    ("elements", "changed", "message"),
    [
        ([], {}, "elements is empty"),
        (Pupil(1e-5), {}, "elements = Pupil.* must be a list"),
        (
            [Pupil(1e-5)],
            {"u": None, "out_dx": 1e-6, "out_shape": (3, 3), "source": 2.0},
            "source = 2",
        ),
        ([FreeSpace(1e-5), "lens"], {}, "elements holds 'lens'"),
        ([Pupil(1e-5), Pupil(1e-5)], {}, "two pupils touch"),
        ([FreeSpace(1e-5), Pupil(1e-5, medium_n=1.33)], {}, r"medium_n = 1, 1\.33"),
        ([FreeSpace(1e-5)], {"u": None, "out_dx": 1e-6, "out_shape": (3, 3)}, "u = None"),
        ([Pupil(1e-5)], {"u": None}, "out_dx, out_shape"),
        ([FreeSpace(1e-5)], {"u": np.full((3, 3), np.nan)}, "u has shape"),
        ([FreeSpace(1e-5)], {"dx": None}, "dx: must be given"),
        ([FreeSpace(1e-5)], {"source": optics.PointSource()}, "source: must not"),
        ([FreeSpace(1e-5)], {"tolerance": 1e-9}, "tolerance"),
        ([FreeSpace(1e-5)], {"wavelength": 0.0}, "wavelength"),
        ([FreeSpace(1e-5)], {"out_shape": ()}, r"out_shape = \(\): must be two whole numbers"),
        ([FreeSpace(1e-5)], {"out_shape": 0}, "out_shape = 0: must be two whole numbers"),
        ([FreeSpace(1e-5)], {"out_shape": {}}, "out_shape = {}: must be two whole numbers"),
        ([FreeSpace(1e-5)], {"out_dx": 0.0}, "out_dx = 0.0: must be greater than 0"),
        ([FreeSpace(1e-5)], {"dtype": "float16"}, "dtype"),
        ([FreeSpace(1e-5), Pupil(4e-3, thin_lens_focal_length=4e-3)], {}, "samples across"),
    ],
)
def test_bad_arguments_are_named(elements, changed, message):
    arguments = {"u": OBJECT, "dx": DX, "wavelength": WAVELENGTH} | changed
    with pytest.raises(ValueError, match=message):
        propagate_through(elements, **arguments)


def test_a_shape_may_be_an_array():
    seen = propagate_through([FreeSpace(1e-5)], OBJECT, dx=DX, wavelength=WAVELENGTH, out_shape=np.array([9, 7]))
    assert seen.u.shape == (9, 7)


@pytest.mark.parametrize("tolerance", [1e-9, 1e-10, 1e-11])
def test_behind_a_disk_light_on_the_axis_is_two_waves_to_the_last_digits(tolerance):
    """The Rayleigh-Sommerfeld integral over a disk is e^{ikz} - z/s e^{iks} with s² = z² + R². The ripple of the soft
    edge is limited to 1e-13, so that no error mentions a ripple that the user did not set.
    """
    radius, z, k = 10e-6, 60e-6, 2 * np.pi / WAVELENGTH
    where = {"out_dx": 1e-6, "out_shape": (9, 9), "wavelength": WAVELENGTH}
    seen = propagate_through([Pupil(radius), FreeSpace(z)], **where, tolerance=tolerance, dtype="float64")
    s = np.hypot(z, radius)
    assert seen.u[4, 4] == pytest.approx(np.exp(1j * k * z) - z / s * np.exp(1j * k * s), rel=10 * tolerance)
    assert seen.predicted_error <= tolerance
    assert (seen.x.size, seen.x[seen.x.size // 2], seen.y[0]) == (9, 0, -4 * seen.dx)
    assert repr(seen).startswith("<StackResult of 9 x 9 samples ")


def test_free_space_has_a_length():
    with pytest.raises(ValueError, match="distance = -1"):
        FreeSpace(-1.0)


def test_derivatives_of_other_libraries_are_refused_not_dropped():
    import torch

    radius, distance = torch.tensor([1e-5, 3e-5], requires_grad=True)
    with pytest.raises(ValueError, match="elements: a pupil requires a derivative of PyTorch, but only"):
        propagate_through([FreeSpace(3e-5), Pupil(radius), FreeSpace(3e-5)], OBJECT, dx=DX, wavelength=WAVELENGTH)
    with pytest.raises(ValueError, match=r"distance requires a derivative of PyTorch: must be a number or a Dr\.Jit"):
        FreeSpace(distance)


@pytest.mark.parametrize("distance", [np.inf, 0.1])
def test_numbers_of_drjit_are_plain_numbers_of_a_source(distance):
    """Numbers with derivatives are refused, also for a source at a finite distance from a decentred pupil."""
    import drjit as dr

    from optics.numerics.precision import precision

    angle = precision("float64").Float64(0.01)
    system = [optics.Misaligned(Pupil(1e-5), (2e-6, 0.0)), FreeSpace(3e-5)]
    asked = {"wavelength": WAVELENGTH, "out_dx": DX, "out_shape": (9, 9)}
    found = propagate_through(system, source=optics.PointSource(distance, (angle, 0.0)), **asked)
    plain = propagate_through(system, source=optics.PointSource(distance, (0.01, 0.0)), **asked)
    assert np.array_equal(found.u, plain.u)
    dr.enable_grad(angle)
    with pytest.raises(ValueError, match="source requires a derivative, but none is propagated"):
        propagate_through(system, source=optics.PointSource(distance, (angle, 0.0)), **asked)


def test_nothing_is_carried_back_from_nowhere():
    with pytest.raises(ValueError, match="u = None: must be given, behind the last element"):
        propagate_through([FreeSpace(3e-5), Pupil(1e-5)], None, wavelength=WAVELENGTH, backward=True, out_dx=DX,
                          out_shape=(9, 9))  # fmt: skip


LENS_TRAIN = [
    part
    for f, z in ((50e-3, 8e-3), (-40e-3, 8e-3), (20e-3, 12e-3))
    for part in (Pupil(0.35e-3, thin_lens_focal_length=f), FreeSpace(z))
]


def test_loose_tolerances_take_fewer_samples_and_keep_their_predictions():
    """Fewer diffracted frequencies are included with a loose tolerance. The result agrees with that of a tight
    tolerance to within the predicted error.
    """
    where = {"wavelength": 550e-9, "out_dx": 1e-6, "out_shape": (96, 96)}
    tight, loose, looser = (
        propagate_through(LENS_TRAIN, **where, tolerance=tolerance) for tolerance in (1e-3, 1e-2, 0.05)
    )
    error = relative_l2(np.abs(loose.u) ** 2, np.abs(tight.u) ** 2)
    assert 1e-5 < error < loose.predicted_error < 1e-2  # not needlessly exact
    assert relative_l2(np.abs(looser.u) ** 2, np.abs(tight.u) ** 2) < looser.predicted_error < 0.05
    work = [sum(step.plan.samples[0] ** 2 for step in out.steps) for out in (tight, loose, looser)]
    assert work[0] > 4 * work[1] >= 4 * work[2]


@pytest.mark.slow
def test_light_outside_both_margins_is_in_the_prediction():
    """Light from the rims of these lenses leaves the window on both sides. If only one side were included, the error
    would exceed the prediction by 7 %.
    """
    aberrations = optics.Zernike({(2, 2): -0.0547, (3, 1): -0.1252, (4, 0): 0.0333})
    system = [
        Pupil(0.1684e-3, thin_lens_focal_length=3.805e-3, wavefront=aberrations), FreeSpace(1.424e-3),
        Pupil(0.2172e-3, thin_lens_focal_length=3.114e-3), FreeSpace(3.594e-3),
    ]  # fmt: skip
    where = {"wavelength": 550e-9, "out_dx": 4.8e-6, "out_shape": (85, 85)}
    tight, loose = (propagate_through(system, **where, tolerance=tolerance) for tolerance in (2e-3, 1e-2))
    error = relative_l2(np.abs(loose.u) ** 2, np.abs(tight.u) ** 2)
    assert 1e-4 < error < loose.predicted_error / 2
