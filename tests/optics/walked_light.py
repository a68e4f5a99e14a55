"""Calls of `optics` without an eye, for the walk of arguments."""

import functools

import numpy as np

import optics
from optics import FreeSpace, Grid, Pupil, encircled_energy
from tests.walked_arguments import NoEffect, Walk, With

RAMP = np.linspace(0, 1e-6, 16).reshape(4, 4)
LENS = {"aperture_radius": 10e-6, "thin_lens_focal_length": 80e-6}
SMALL = {"dx": 1e-6, "shape": (9, 9), "tolerance": 1e-2}
U = np.exp(-np.add.outer(np.linspace(-2, 2, 16) ** 2, np.linspace(-2, 2, 16) ** 2))
STEPS = {"dx": 1e-6, "wavelength": 5e-7, "distance": 1e-4}
BLUE = {"wavelength": 400e-9}
INTERNAL = NoEffect("planners call it; its effect is the accuracy of PSFs")
SAME = NoEffect("a part of a result that other code computes")


def bright(**given):
    """Return the PSF of a pupil."""
    return optics.psf(Pupil(**{**LENS, **given}), sensor_distance=80e-6, source_distance=1e-3, **SMALL).psf


def seen(**asked):
    """Return the PSF and the plan of `optics.psf`."""
    found = optics.psf(optics.Pupil(**LENS, height=optics.BSplineRelief(RAMP)), **{**SMALL, **asked})
    return found.psf, found.x, found.plan.method, found.field


PSF = optics.psf(Pupil(**LENS), dx=0.8e-6, shape=(33, 33))
FOCUS = optics.vector_focus(Pupil(**LENS), dx=1e-6, shape=(33, 33))


def absorbed(**given):
    return optics.Microvilli(**given).signal(FOCUS_POLARISED, 3e-6)


FOCUS_POLARISED = optics.vector_focus(Pupil(**LENS), polarization=(1, 0), dx=1e-6, shape=(33, 33))
MICRO = optics.Microvilli()


def vectors(**asked):
    lens = Pupil(40e-6, thin_lens_focal_length=80e-6)
    found = optics.vector_focus(lens, **{"dx": 1e-6, "shape": (9, 9), "tolerance": 1e-2, **asked})
    return found.psf, found.plan.predicted_error


def carried(**asked):
    found = optics.propagate(U, **{**STEPS, **asked})
    return found.u, found.x, found.plan.method, found.plan.predicted_error


def through(**asked):
    elements = asked.pop("elements", [Pupil(10e-6), FreeSpace(1e-4), Pupil(20e-6)])
    found = optics.propagate_through(elements, **{"wavelength": 5e-7, "out_dx": 2e-6, "out_shape": (8, 8), **asked})
    return found.u, found.x, found.predicted_error


def through_batch(**asked):
    systems = [[Pupil(10e-6), FreeSpace(1e-4), Pupil(20e-6), FreeSpace(distance)] for distance in (1e-4, 1.1e-4)]
    settings = {"wavelength": 5e-7, "out_dx": 2e-6, "out_shape": (8, 8), **asked}
    return [(each.u, each.predicted_error) for each in optics.propagate_through_batch(systems, **settings)]


def white(**asked):
    return optics.white_psf(Pupil(**LENS), **{"dx": 1e-6, "shape": (9, 9), **asked}).psf


@functools.cache
def in_white():
    return optics.white_psf(Pupil(**LENS), waves=17, dx=0.8e-6, shape=(33, 33), tolerance=0.1)


def batch(**asked):
    found = optics.psf_batch([Pupil(**LENS)], **{**SMALL, **asked})
    return found.psf, found.x, [plan.why for plan in found.plans]


OF_PSFS = {
    "psf": Walk(
        seen,
        {
            "wavelengths": (450e-9,),
            "sensor_distance": 9e-5,
            "source_distance": 1e-3,
            "source_angle": (0.05, 0.0),
            "dx": 2e-6,
            "shape": (7, 9),
            "tolerance": 1e-4,
            "method": "rayleigh_sommerfeld",
            "dtype": "float64",
            "centre": (1e-6, 0.0),
            "field": True,
        },
    ),
    "plan": Walk(
        lambda **asked: optics.plan(Pupil(**LENS, height=optics.BSplineRelief(RAMP)), **{**SMALL, **asked}),
        {
            "wavelength": 450e-9,
            "sensor_distance": 4e-4,
            "source_distance": 1e-4,
            "source_angle": (0.3, 0.0),
            "dx": 8e-6,
            "shape": (65, 99),
            "tolerance": 1e-4,
            "method": "rayleigh_sommerfeld",
            "dtype": "float64",
            "centre": (1e-4, 0.0),
        },
    ),
    "psf_batch": Walk(
        batch,
        {
            "wavelengths": (450e-9,),
            "sensor_distance": 9e-5,
            "source_distances": (1e-3,),
            "dx": 2e-6,
            "shape": (7, 9),
            "tolerance": 1e-4,
            "method": "rayleigh_sommerfeld",
            "dtype": "float64",
        },
    ),
    "white_psf": Walk(
        white,
        {"light": "A", "receptors": "honeybee", "waves": With(65, {"tolerance": 0.3}), "tolerance": 1e-3},
    ),
    "vector_focus": Walk(
        vectors,
        {
            "wavelength": 450e-9,
            "sensor_distance": 9e-5,
            "polarization": (1, 0),
            "source_angle": (0.02, 0.0),
            "apodization": "aplanatic",
            "dx": 2e-6,
            "shape": (7, 9),
            "tolerance": 1e-4,
        },
    ),
    "propagate": Walk(
        carried,
        {
            "out_dx": 2e-6,
            "out_shape": (8, 8),
            "out_centre": (1e-6, 0.0),
            "medium_n": 1.3,
            "tolerance": With(0.3, {"distance": 3e-5, "dx": 3e-7}),
            "method": "fresnel",
            "dtype": "float64",
        },
    ),
    "propagate_through": Walk(
        through,
        {
            "u": With(np.tri(16), {"u": U, "dx": 1e-6, "elements": [FreeSpace(1e-4)]}),
            "dx": With(2e-6, {"u": U, "dx": 1e-6, "elements": [FreeSpace(1e-4)]}),
            "source": optics.PointSource(1e-3),
            "out_dx": 1e-6,
            "out_shape": (4, 8),
            "tolerance": 1e-4,
            "dtype": "float64",
            "backward": With(True, {"u": U, "dx": 1e-6, "elements": [FreeSpace(1e-4), Pupil(20e-6)]}),
        },
    ),
    "propagate_through_batch": Walk(
        through_batch, {"source": optics.PointSource(1e-3), "tolerance": 1e-4, "dtype": "float64"}
    ),
    "FreeSpace": Walk(
        lambda **given: through(u=U, dx=1e-6, elements=[FreeSpace(1e-4, **given)]),
        {"medium_n": 1.3},
    ),
    "Misaligned": Walk(
        lambda **given: through(elements=[optics.Misaligned(Pupil(**LENS), **given), FreeSpace(8e-5)], tolerance=0.05),
        {"decentre": (1e-6, 0.0), "tilt": (0.05, 0.0)},
    ),
    "Grid": Walk(lambda **given: Grid((3, 3), 1.0, **given).x, {"centre": (1.0, 0.0)}),
}


ERROR = {"with_error": True}
OF_MEASURES = {
    "mtf": Walk(
        lambda **asked: (lambda found: (found.mtf, found.predicted_error))(optics.mtf(PSF, **asked)),
        {"arriving": 0.97, "tolerance": 1e-3},
    ),
    "MTF.profile": Walk(lambda **asked: optics.mtf(PSF).profile(np.array([1e4]), **asked), ERROR),
    "image_quality": Walk(
        lambda **asked: optics.image_quality(PSF, 1e5, **asked),
        {"throughput": 0.5, "noise_sigma": 0.1, "tolerance": 1e-3, **ERROR},
    ),
    "strehl_ratio": Walk(lambda **asked: optics.strehl_ratio(PSF, **asked), ERROR),
    "encircled_energy": Walk(lambda **asked: encircled_energy(PSF, 3e-6, **asked), {"centre": (1e-6, 0.0), **ERROR}),
    "WhitePSF.mtf": Walk(lambda **asked: in_white().mtf(**asked).mtf, {"tolerance": 5e-3}),
    "WhitePSF.strehl_ratio": Walk(lambda **asked: in_white().strehl_ratio(**asked), ERROR),
    "WhitePSF.encircled_energy": Walk(
        lambda **asked: in_white().encircled_energy(3e-6, **asked), {"centre": (1e-6, 0.0), **ERROR}
    ),
    "Microvilli": Walk(absorbed, {"azimuth_deg": 40.0, "dichroic_ratio": 3.0}),
    "Microvilli.signal": Walk(lambda **asked: MICRO.signal(FOCUS, 3e-6, **asked), {"centre": (1e-6, 0.0), **ERROR}),
    "Microvilli.polarization_sensitivity": Walk(
        lambda **asked: MICRO.polarization_sensitivity(FOCUS, 3e-6, **asked), {"centre": (5e-6, 1e-6)}
    ),
    "PSFBatch.result": Walk(
        lambda **asked: optics.psf_batch([Pupil(**LENS)], source_distances=(1.0, 1e-3), **SMALL).result(0, **asked).psf,
        {"depth": 1},
    ),
}
# Parts of results and functions that only planners call.
OF_PARTS = {
    **{
        f"{name}.soften": Walk(bright, {"widest_reach": INTERNAL})
        for name in ("Annulus", "Circle", "Combined", "Polygon", "Rings", "Slit")
    },
    **{f"{name}.detail": Walk(bright, {"part": INTERNAL}) for name in ("HeightMap", "WavefrontMap", "Zernike")},
    "PSFResult": Walk(bright, dict.fromkeys(("centre", "requests", "shares", "field_parts", "for_window"), SAME)),
    "MTF": Walk(bright, dict.fromkeys(("centre", "causes"), SAME)),
    "Plan": Walk(bright, dict.fromkeys(("seconds", "options", "padding", "scalar_error", "derivative_error"), SAME)),
    "VectorFocus": Walk(bright, {"towards": SAME}),
}
