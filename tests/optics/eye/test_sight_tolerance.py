"""The tolerance of sight and bands refers to the white signal behind the mask or waveguide, and to the sum of all
errors."""

import itertools
import math

import numpy as np
import pytest

from optics import AccuracyError, Eye, MaskMap, Pupil, Waveguide
from optics.eye.band_choice import choose_bands
from optics.eye.kernel_bank import _choices, prepare
from optics.eye.kernel_interpolation import NodeChoice, nodes, worst_difference
from optics.numerics.autodiff import plain
from optics.numerics.interpolation import linear_weights

S, DEPTHS = 2, np.array([0.6e-3, 5e-3])


def lens(amplitude, **others):
    mask = None if amplitude == 1 else MaskMap(np.full((4, 4), amplitude))
    focal = Eye().sensor_distance
    return Eye(Pupil(25e-6, thin_lens_focal_length=focal, mask=mask), (7, 9), bands=1, **others)


@pytest.mark.parametrize("tolerance", [0.1, 0.03])
def test_an_even_mask_changes_no_choice(tolerance):
    """The mask dims the scene and white alike. An amplitude of 0.2 transmits 1/25 of the light. If errors were relative
    to white without the mask, they would be smaller by this factor, and one layer would be chosen instead of three, or
    three instead of five.
    """
    open_, dim = (lens(amplitude).sight(S, DEPTHS, tolerance=tolerance).choices[0] for amplitude in (1, 0.2))
    assert dim.counts == open_.counts
    assert dim.counts[0] > 1
    assert dim.predicted_error == pytest.approx(open_.predicted_error, rel=0.02)


def between(bank, place):
    """Kernels of a bank, interpolated at a place (depth, row, column) in [-1, 1]³."""
    counts = [count for choice in bank.choices for count in choice.counts]
    shares = [linear_weights(np.asarray(at), nodes(n)) for at, n in zip(place, counts, strict=True)]
    all_nodes = itertools.product(*(range(n) for n in counts))
    found = [(math.prod(float(s[i]) for s, i in zip(shares, node, strict=True)), node) for node in all_nodes]
    return [(share, plain(bank.kernels[node])) for share, node in found if share > 0]


def distance(near, far, place):
    return 2 / (1 / near + 1 / far + place * (1 / near - 1 / far))


@pytest.mark.slow
def test_waveguides_err_by_no_more_of_what_they_leave_of_white():
    """A rhabdom of 1.4 µm collects 0.16 of the light of a square receptor. If the tolerance were not scaled by this
    factor, one layer would be chosen, with an error of 0.2 of white.
    """
    focal, width = 50e-6, 27e-6
    pupil = Pupil(12.5e-6, thin_lens_focal_length=67e-6, medium_n=1.34, object_n=1.0)
    fov = 2 * math.degrees(math.atan(width / 2 / focal))
    eye = Eye(pupil, (9, 9), fov, width, 1, waveguide=Waveguide(1.4e-6), full_aperture=1e-4)
    near, far, tolerance = 0.3e-3, 10.0, 0.05
    bank, share = eye.sight(4, [near, far], tolerance=tolerance), eye.white_signal / eye.throughput
    assert share < 0.17
    errors = {}
    for place in np.linspace(-1, 1, 9):
        [exact] = eye.sight(4, distance(near, far, place)).kernels.values()
        for count, those in ((len(bank.kernels), bank), (1, eye.sight(4, [near, far], depth_layers=1))):
            error = worst_difference([*between(those, (place, 0, 0)), (-1, plain(exact))], 1)
            errors[count] = max(errors.get(count, 0), error)
    assert errors[len(bank.kernels)] < tolerance * share < errors[1] / 2 < tolerance / 2


def test_dim_kernels_need_as_many_bands():
    def hopping(wavelengths):
        kernels = np.zeros((len(wavelengths), 41, 41))
        place = (np.asarray(wavelengths) - 400e-9) / 300e-9 * 12 + 14
        cell = np.floor(place).astype(int)
        for i, (at, share) in enumerate(zip(cell, place - cell, strict=True)):
            kernels[i, :, at], kernels[i, :, at + 1] = (1 - share) / 41, share / 41
        return kernels

    bright, dim = (choose_bands(0.1, kernels=lambda at, s=scale: s * hopping(at)) for scale in (1, 0.05))
    assert len(dim.wavelengths) == len(bright.wavelengths) > len(choose_bands(0.1).wavelengths)


@pytest.mark.slow
def test_depth_and_field_share_a_tolerance():
    """Both errors add up at a corner between two layers. If each had the whole tolerance, one layer and five zones
    would be chosen, with an error of 0.068."""
    eye = Eye(Pupil(30e-6, thin_lens_focal_length=240e-6), (1, 15), 45.0, bands=1)
    near, far, tolerance = 2e-3, 1.0, 0.065
    bank = eye.sight(S, [near, far], field_zones="auto", tolerance=tolerance, light_from="centres")
    assert sum(choice.predicted_error for choice in bank.choices) <= tolerance
    assert "within the tolerance of 0.065, of which" in str(bank)
    worst = 0.0
    for deep, right in itertools.product(np.linspace(-1, 1, 5), np.linspace(0.5, 1, 5)):
        aside = math.degrees(math.atan(right * math.tan(math.radians(22.5))))
        exact = eye.kernel(S, distance(near, far, deep), (aside, 0))
        worst = max(worst, worst_difference([*between(bank, (deep, 0, right)), (-1, exact)], S))
    assert worst <= tolerance
    alone = eye.sight(S, [near, far], depth_layers=1, field_zones="auto", tolerance=tolerance)
    assert math.prod(alone.choices[1].counts) <= math.prod(bank.choices[1].counts)


def test_a_share_of_the_tolerance_is_named_where_it_is_too_small():
    choice = NodeChoice("test", lambda at: np.full((1, 1, 1), at[0] ** 2), [(3,), (5,)], 1)
    with pytest.raises(
        AccuracyError, match=r"tolerance = 0\.09, of which test may use 0\.05: 5 test nodes leave 8\.1e-02"
    ):
        choice.choose(0.09, 0.05)
    assert choice.choose(0.09).counts == (5,)


def test_no_light_is_no_error():
    """All errors are 0 if white is 0."""
    dark = NodeChoice("test", lambda at: np.zeros((1, 3, 3)), [(1,)], 1, white=0.0)
    assert dark.choose(1e-6).predicted_error == 0


def test_the_field_comes_first_where_half_is_too_little_for_depth():
    along = NodeChoice("depth", lambda at: np.full((1, 1, 1), at[0] ** 2), [(5,)], 1)
    even = NodeChoice("field", lambda at: np.ones((1, 1, 1)), [(1, 1)], 1)
    depth, wide = _choices((along, even), (None, None), 0.1)
    assert (depth.counts, wide.counts) == ((5,), (1, 1))
    assert 0.05 < depth.predicted_error + wide.predicted_error <= 0.1
    with pytest.raises(AccuracyError, match="5 depth nodes leave"):
        _choices((along, even), (None, None), 0.08)


def test_what_is_left_of_white_is_not_asked_where_no_error_is_told():
    """The white signal of a waveguide needs a kernel, so it is computed only if an error is predicted."""

    def nobody_asks():
        raise AssertionError

    def kernel_at(z, right, down):
        return np.ones((1, 1, 1))

    assert prepare(kernel_at, (3, 3), 1, math.inf, (1, 1), 0.01, white=nobody_asks).kernels
