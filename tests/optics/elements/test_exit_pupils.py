"""Several fields and wavelengths of a Cooke triplet, compared with positions that optiland 0.6.3 gives."""

from types import SimpleNamespace

import numpy as np
import pytest

import optics
from tests.optics.elements.traced_lens import triplet

# y [mm] of the chief rays on the image plane at 14° and 20°, for 0.48, 0.55 and 0.65 µm.
OPTILAND = (
    (12.419648339623176, 12.419794670772845, 12.419872147101385),
    (18.135854603717867, 18.136025932761, 18.136259742540524),
)
MICRONS = (0.55, 0.48, 0.65)


def traced(fields=(0, 14, 20), **asked):
    return {((0.0, angle / 20), um): triplet(angle, um * 1e-6, **asked) for angle in fields for um in MICRONS}


def test_positions_and_lateral_colour_are_those_of_optiland():
    lens = optics.read_exit_pupils(SimpleNamespace(data=traced(), remove_tilt=False))
    assert lens.fields == ((0.0, 0.0), (0.0, 0.7), (0.0, 1.0))
    assert lens.wavelengths == pytest.approx([0.48e-6, 0.55e-6, 0.65e-6])
    y = np.array(OPTILAND) * 1e-3
    assert lens.positions[1:, :, 1] == pytest.approx(y, abs=1e-10)
    assert lens.positions[0] == pytest.approx(0)
    assert lens.lateral_colour[1:, :, 1] == pytest.approx(y - y[:, [1]], abs=1e-11)
    assert lens.lateral_colour[2, 2, 1] == pytest.approx(0.2338e-6, abs=1e-10)


def test_the_pupils_of_a_field_have_one_origin():
    """The wavefronts of other wavelengths therefore contain a tilt, which moves the image by the lateral colour."""
    lens = optics.read_exit_pupils(traced((20,)))
    blue = lens.at(0)[0]
    places = {pupil.position for pupil in lens.at(0)}
    assert len(places) == 1
    aside, alone = float(lens.lateral_colour[0, 0, 1]), lens.pupils[0][0]
    window = {"dx": 1e-6, "shape": (41, 41)}
    seen, there, here = (
        optics.psf(one.pupil, [0.48e-6], one.distance, centre=(0.0, y), **window).psf
        for one, y in ((blue, 0.0), (alone, -aside), (alone, 0.0))
    )
    assert np.linalg.norm(seen - there) < 3e-3 * np.linalg.norm(there)
    assert np.linalg.norm(seen - here) > 0.05 * np.linalg.norm(there)


@pytest.mark.parametrize(
    ("system", "asked", "says"),
    [
        ({}, {}, r"system = \{\}: must be optiland's Wavefront, or"),
        (triplet(0, 0.55e-6), {}, "must be optiland's Wavefront, or"),
        ({"green": triplet(0, 0.55e-6)}, {}, "must be optiland's Wavefront, or"),
        (SimpleNamespace(data=traced((0,)), remove_tilt=True), {}, "remove_tilt = True: the positions of the images"),
        (
            {k: v for k, v in traced((0, 20)).items() if k != ((0.0, 1.0), 0.65)},
            {},
            r"lacks the field \(0.0, 1.0\) at 0.65",
        ),
        ({(0, -0.5): triplet(0, 0.55e-6)}, {}, "wavelength = -0.5: must be"),
        (
            traced((14, 20)),
            {"image_normal": (0.0, 0.1, 1.0)},
            "the images lie 0.000569 m apart along image_normal: must",
        ),
        (
            {(0, 0.55): SimpleNamespace(data=np.ones((64, 64), complex), dx=0.02, wavelength=0.55)},
            {},
            "focal_length is missing: this object does not contain",
        ),
    ],
)
def test_incomplete_lenses_are_refused_in_a_line(system, asked, says):
    with pytest.raises(ValueError, match=says) as error:
        optics.read_exit_pupils(system, **asked)
    assert "\n" not in str(error.value)


def test_a_curved_image_is_refused():
    data = traced((0,)) | {((0.0, 1.0), um): triplet(20, um * 1e-6, shift=-0.05) for um in MICRONS}
    with pytest.raises(ValueError, match="the images lie 5e-05 m apart along image_normal: must lie on one plane"):
        optics.read_exit_pupils(data)


def test_fields_are_counted_from_0():
    lens = optics.read_exit_pupils(traced((0,)))
    with pytest.raises(ValueError, match="field = 1: must be"):
        lens.at(1)
    assert repr(lens) == "<ExitPupils of 1 field at 3 wavelengths>"
