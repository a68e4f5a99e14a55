"""Calls of apertures, pupils and lenses, for the walk of arguments."""

from types import SimpleNamespace

import numpy as np

import optics
from optics import Zernike
from tests.optics.walked_light import BLUE, RAMP, SMALL, bright, through
from tests.walked_arguments import NoEffect, Walk, With


def opened(shape):
    """Return the PSF behind an aperture, or behind a shape in a union."""
    return bright(aperture=optics.union(shape))


def ball(**given):
    water = optics.medium("water")
    return optics.BallLens(1e-3, optics.RefractiveIndex(1.5, 4e-15), water, water, **given)


def exit_pupil(**asked):
    x = (np.arange(64) - 32) / 14
    r2 = np.add.outer(x**2, x**2)
    data = (r2 <= 4) * np.exp(0.2j * r2**2)
    wave = SimpleNamespace(data=data, dx=1 / 14, wavelength=0.555)
    found = optics.read_exit_pupil(wave, 555e-9, **{"focal_length": 0.02, **asked})
    return found.pupil, found.distance, found.rms


def indexed(**given):
    return [optics.RefractiveIndex(1.4, **given).at(wavelength) for wavelength in (4e-7, 6e-7)]


def human(**given):
    eye = optics.HumanEye(**given)
    return optics.psf(eye.pupil, sensor_distance=eye.focal_length, dx=2e-6, shape=(9, 9), tolerance=1e-2).psf


OF_SHAPES = {
    "Disk": Walk(lambda **given: opened(optics.Disk(0.4, **given)), {"centre": (0.3, 0.1)}),
    "Oblong": Walk(
        lambda **given: opened(optics.Oblong(0.5, 0.9, **given)), {"centre": (0.1, 0.2), "rotation_deg": 20.0}
    ),
    "Spider": Walk(
        lambda **given: bright(aperture=optics.difference(optics.Disk(1.0), optics.Spider(3, 0.1, **given))),
        {"rotation_deg": 20.0},
    ),
    "hexagonal_segments": Walk(
        lambda **given: bright(aperture=optics.hexagonal_segments(1, **given)),
        {"gap": 0.1, "rotation_deg": 10.0, "without": (0,)},
    ),
    "Polygon.regular": Walk(lambda **given: bright(aperture=optics.Polygon.regular(3, **given)), {"rotation_deg": 9.0}),
    "Rings.zone_plate": Walk(
        lambda **given: optics.Rings.zone_plate(20e-6, 40e-6, **given), {"wavelength": 4e-7, "open_centre": False}
    ),
}
OF_PUPILS = {
    "Pupil": Walk(
        bright,
        {
            "height": optics.BSplineRelief(RAMP),
            "n": With(1.6, {"height": optics.BSplineRelief(RAMP)}),
            "medium_n": 1.33,
            "thin_lens_focal_length": 60e-6,
            "aperture": optics.Annulus(0.5),
            "wavefront": Zernike({(4, 0): 0.1}),
            "mask": optics.GaussianMask(5e-6),
            "object_n": With(1.33, {"medium_n": 1.4}),
        },
        {"aperture_radius": 10e-6},
    ),
    "BallLens": Walk(lambda **given: ball(**given).focal_length(), {"shape": lambda u: 1 - u**4}),
    "BallLens.luneburg": Walk(
        lambda **given: optics.BallLens.luneburg(1e-3, 1.336, **given).focal_length(), {"focal_ratio": 2.5}
    ),
    "BallLens.maxwell": Walk(lambda **given: optics.BallLens.maxwell(1e-3, **given).index(0.0), {"medium_n": 1.336}),
    **{
        f"BallLens.{name}": Walk(lambda name=name, **asked: getattr(ball(), name)(2e-4, **asked), BLUE)
        for name in ("deviation", "focus", "index", "turning")
    },
    "BallLens.pupil": Walk(lambda **asked: ball().pupil(2e-4, **asked).thin_lens_focal_length, BLUE),
    "BallLens.focal_length": Walk(lambda **asked: ball().focal_length(**asked), BLUE),
    "HumanEye": Walk(
        lambda **given: human(**given),
        {"aperture_radius": 1e-3, "wavefront": None, "centered": True},
    ),
    "MaskMap": Walk(lambda **given: bright(mask=optics.MaskMap(RAMP * 8e5, **given)), {"reach": 2e-5}),
    "WavefrontMap": Walk(lambda **given: bright(wavefront=optics.WavefrontMap(RAMP, **given)), {"radius": 2e-5}),
    "Zernike": Walk(lambda **given: bright(wavefront=Zernike({(4, 0): 0.2}, **given)), {"radius": 2e-5}),
    "Zernike.from_noll": Walk(
        lambda **given: bright(wavefront=Zernike.from_noll({11: 0.2}, **given)), {"radius": 2e-5}
    ),
    "Zernike.from_fringe": Walk(
        lambda **given: bright(wavefront=Zernike.from_fringe({9: 0.2}, **given)), {"radius": 2e-5}
    ),
    "PointSource": Walk(
        lambda **given: through(source=optics.PointSource(**given)), {"distance": 5e-5, "angle": (0.02, 0.0)}
    ),
    "RefractiveIndex": Walk(indexed, {"b": 4e-15, "c": 1e-28, "d": 1e-42}),
    "phase_pupil": Walk(
        lambda **given: optics.psf(optics.phase_pupil(1e-5, 3e6 * RAMP, **given), **SMALL).psf, {"pixels": True}
    ),
    "read_exit_pupil": Walk(
        exit_pupil,
        {"medium_n": 1.33, "focal_length": 0.03, "order": 4, "image_normal": NoEffect("test_exit_pupil_off_axis")},
    ),
}
