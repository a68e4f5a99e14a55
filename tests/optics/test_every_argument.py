"""Every optional argument of the public functions and classes of `optics` changes a result.

Values are changed in calls that read them: a field of a `Pupil`, for example, must change a PSF.
"""

import math
import warnings

import pytest

import optics
from optics import Eye, Pupil
from tests.optics.walked_eyes import LENS, OF_EYES, OF_FACETS, SCENE
from tests.optics.walked_lenses import OF_LENSES
from tests.optics.walked_light import OF_MEASURES, OF_PARTS, OF_PSFS
from tests.optics.walked_pupils import OF_PUPILS, OF_SHAPES
from tests.walked_arguments import Walk, missing

TABLE = {**OF_SHAPES, **OF_PUPILS, **OF_PSFS, **OF_MEASURES, **OF_EYES, **OF_FACETS, **OF_LENSES, **OF_PARTS}


def test_the_table_names_every_optional_argument():
    assert missing(optics, TABLE) == []


# Calls that take more than a second.
LONG = {
    name
    for name in TABLE
    if name.startswith(
        (
            "AppositionEye",
            "Eye",
            "WhitePSF",
            "read_exit",
            "lens_mtf",
            "LensMTF",
            "white_psf",
            "image_quality",
            "propagate_through",
            "Ommatidium",
        )
    )
}
NAMES = [
    pytest.param(name, marks=[pytest.mark.slow] if name in LONG else []) for name in sorted(set(TABLE) - set(OF_PARTS))
]


@pytest.mark.parametrize("name", NAMES)
def test_every_argument_changes_a_result(name):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert TABLE[name].unchanged() == []


def test_polarized_light_changes_signals_behind_microvilli():
    eye = Eye(Pupil(**LENS), (2, 2), 60.0, bands=1, receptors=(500,), microvilli=optics.Microvilli())
    seen = [eye.see(SCENE, 2, polarization=each) for each in (None, (1.0, 0.0), (1.0, 90.0))]
    assert math.isclose(seen[0].sum(), (seen[1] + seen[2]).sum() / 2, rel_tol=1e-3)
    assert abs(seen[1] - seen[2]).max() > 0.1 * seen[0].max()


def test_an_argument_without_effect_is_found():
    """A walk of a function that ignores one of its arguments."""
    walk = Walk(lambda used=0, ignored=0: used, {"used": 1, "ignored": 1})
    assert walk.unchanged() == ["ignored"]
