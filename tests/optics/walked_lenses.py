"""Calls of functions for lenses of other programs, for the walk of arguments."""

import functools

import optics
from tests.optics.elements.traced_lens import triplet
from tests.walked_arguments import Walk

MICRONS = (0.48, 0.55)
TILTED = (0.0, 0.2, 1.0)


@functools.cache
def rays(microns=0.55):
    return triplet(20, microns * 1e-6)


def moved(**asked):
    found = optics.read_exit_pupil(rays(), 0.55e-6).moved(1e-5, **asked)
    return found.pupil, found.position


def several(**asked):
    return optics.read_exit_pupils({(20, 0.55): rays()}, **asked)


def pupils(**asked):
    return [one.pupil for one in several(**asked).pupils[0]]


def at(**asked):
    return [(one.pupil, one.position) for one in several().at(0, **asked)]


@functools.cache
def lens():
    return optics.read_exit_pupils({(20, um): rays(um) for um in MICRONS})


def contrasts(**asked):
    found = optics.lens_mtf(lens(), 20e3, **asked)
    return found.tangential, found.predicted_error


def plotted(**asked):
    from matplotlib.figure import Figure

    axes = Figure().subplots()
    optics.lens_mtf(several(), [20e3, 50e3], [0.0, 1e-5], tolerance=0.1).plot(axes, **asked)
    return [line.get_ydata() for line in axes.lines]


OF_LENSES = {
    "ExitPupil.moved": Walk(moved, {"origin": (0.0, 0.0181)}),
    "ExitPupils.at": Walk(at, {"shift": 1e-5}),
    "LensMTF.plot": Walk(plotted, {"frequency": 20e3}),
    "lens_mtf": Walk(contrasts, {"shifts": 1e-5, "weights": [1.0, 0.0], "tolerance": 0.2}),
    "read_exit_pupils": Walk(pupils, {"medium_n": 1.33, "order": 4, "image_normal": TILTED}),
}
