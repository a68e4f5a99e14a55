"""Choices of nodes, layers of scenes, polarised parts and limits of eyes, from given numbers."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import optics
from optics.eye import occlusion, polarization, summary, visual_kernel
from optics.eye.kernel_bank import KernelBank, _choices, _grid, _rest
from optics.eye.kernel_interpolation import Choice, NodeChoice, NodeError, checks, nodes
from optics.numerics.accuracy import AccuracyError


class Stage:
    """A stage whose choice has a given error; it fails if less is available."""

    def __init__(self, name, error):
        self.name, self.error, self.asked = name, error, []

    def choose(self, tolerance, most=None):
        self.asked.append((tolerance, most))
        if self.error > (tolerance if most is None else most):
            raise NodeError("too few")
        return Choice(self.name, (3,), self.error, "")


@pytest.mark.parametrize(
    ("errors", "depth_asked", "field_asked"),
    [
        ((0.1, 0.2), [(1.0, 0.5)], [(1.0, 0.9)]),
        ((0.0, 0.2), [(1.0, 0.5)], [(1.0, None)]),  # a depth without error leaves all
        ((0.7, 0.2), [(1.0, 0.5), (1.0, 0.8)], [(1.0, 0.5)]),
    ],
)
def test_depth_and_field_share_the_tolerance(errors, depth_asked, field_asked):
    stages = Stage("depth", errors[0]), Stage("field", errors[1])
    found = _choices(stages, (None, None), 1.0)
    assert [choice.stage for choice in found] == ["depth", "field"]
    assert stages[0].asked == depth_asked
    assert [(tolerance, most and pytest.approx(most)) for tolerance, most in stages[1].asked] == field_asked


@pytest.mark.parametrize("spent", [0.25, None])
def test_the_field_may_use_what_a_requested_depth_leaves(spent):
    stages = Stage("depth", 0.1), Stage("field", 0.1)
    depth, wide = Choice("depth", (2,), spent, ""), Choice("field", (2, 2), None, "")
    assert _choices(stages, (depth, None), 1.0)[0] is depth
    assert stages[1].asked == [(1.0, None if spent is None else 0.75)]
    assert _choices(stages, (None, wide), 1.0)[1] is wide
    assert stages[0].asked == [(1.0, None)]
    assert (_rest(1.0, 0.0), _rest(1.0, None), _rest(1.0, 0.4)) == (None, None, 0.6)


@pytest.mark.parametrize(
    ("across", "resolution", "grid"),
    [
        (1, (8, 8), (1, 1)),
        (9, (8, 8), (9, 9)),
        (9, (8, 16), (5, 9)),
        (9, (16, 4), (9, 3)),
        (5, (1, 16), (1, 5)),
        (9, (2, 64), (1, 9)),
        (9, (12, 16), (9, 9)),
    ],
)
def test_grids_of_nodes_are_as_dense_along_both_axes(across, resolution, grid):
    assert _grid(across, resolution) == grid


def test_places_between_nodes():
    assert nodes(1).tolist() == [0]
    assert nodes(3).tolist() == [-1, 0, 1]
    assert checks((1,)) == [(-1,), (1,)]
    assert len(checks((1, 1))) == 8
    assert (0.0, 0.0) not in checks((1, 1))
    assert checks((3,)) == [(-0.5,), (0.5,)]
    assert checks((3, 1)) == [(-0.5, 0.0), (0.5, 0.0)]
    assert len(checks((9,))) == 8
    many = checks((5, 5))
    assert len(many) == 8
    assert {(down, right) for down in (-0.75, 0.75) for right in (-0.75, 0.75)} < set(many)


@pytest.mark.parametrize(("tolerance", "most", "counts"), [(1.3, None, 1), (1.29, None, 3), (9, 0.65, 3), (9, 0.6, 5)])
def test_the_fewest_nodes_within_the_tolerance(monkeypatch, tolerance, most, counts):
    """Errors are multiplied by 1.3: 1, 0.5 and 0.25 for one, three and five nodes."""
    monkeypatch.setattr(NodeChoice, "error", lambda self, counts: {1: 1.0, 3: 0.5, 5: 0.25}[counts[0]])
    stage = NodeChoice("depth", None, [(1,), (3,), (5,)], 1)
    found = stage.choose(tolerance, most)
    assert (found.stage, found.counts) == ("depth", (counts,))
    assert found.predicted_error == pytest.approx(1.3 * {1: 1.0, 3: 0.5, 5: 0.25}[counts])
    assert ("is available here" in found.why) == (most is not None)
    with pytest.raises(NodeError, match=r"tolerance = 0\.3: 5 depth nodes leave 3\.3e-01 of the signal of white"):
        stage.choose(0.3)
    with pytest.raises(NodeError, match=r"tolerance = 9, of which depth may use 0\.3: 5 depth"):
        stage.choose(9, 0.3)


def test_choices_are_printed_with_their_errors():
    assert str(Choice("depth", (3,), 0.012, "why")) == "depth        3   error 1.2e-02  why"
    assert str(Choice("field", (3, 5), None, "as requested")) == "field    3 x 5   not predicted  as requested"


def bank(kernels=((0, 0, 0),), field=(2.0, 3.0), averaged=True):
    planes = dict.fromkeys(kernels, np.zeros((4, 1, 1)))
    return KernelBank((0.0, 1.0), field, planes, (), averaged)


def test_shares_of_nodes_are_linear():
    """Two layers, and three columns of nodes over a retina of 4 x 6 cells."""
    nodes_ = [(i, 0, k) for i in range(2) for k in range(3)]
    near = np.random.default_rng(0).random((4, 6))
    shares = bank(nodes_).shares(near)
    at = (np.arange(6) - 2.5) / 3
    columns = [np.maximum(-at, 0), 1 - abs(at), np.maximum(at, 0)]
    for share, (i, _, k) in zip(shares, nodes_, strict=True):
        np.testing.assert_allclose(share, (near if i else 1 - near) * columns[k])
    np.testing.assert_allclose(sum(shares), 1)
    rows = bank([(0, j, 0) for j in range(2)]).shares(np.zeros((4, 6)))
    np.testing.assert_allclose(rows[1][:, 0], np.array([1, 3, 5, 7]) / 8)
    assert bank().shares(near) == [1]


def test_banks_fit_their_eyes():
    found = bank()
    found.check((4, 6), 4, averaged=True)
    for shape, bands, averaged, reason in (
        ((6, 6), 4, True, "sight is for a retina of 4 x 6 cells: must be for 6 x 6"),
        ((4, 4), 4, True, "sight is for a retina of 4 x 6 cells: must be for 4 x 4"),
        ((4, 6), 3, True, "sight is for 4 bands: must be for 3, as the eye has"),
        ((4, 6), 4, False, "sight is for an eye without waveguides: must be for one with"),
    ):
        with pytest.raises(ValueError, match=f"^{reason}$"):
            found.check(shape, bands, averaged=averaged)
    with pytest.raises(ValueError, match=r"^sight is for an eye with waveguides: must be for one without$"):
        bank(averaged=False).check((4, 6), 4, averaged=True)


def test_jumps_of_depth_that_hide():
    depth = np.array([[0.0, 1.0]])
    assert occlusion._least_jump(depth, 0.0) == math.inf
    assert occlusion._least_jump(depth, 2.0) == 0.25
    assert occlusion._least_jump(depth, 1000.0) == 1 / 64
    values = np.array([[1.0, 5.0, 2.0], [3.0, 9.0, 4.0]])
    cells = np.array([[True, False, True], [True, False, False]])
    expected = np.array([[3, 3, 2], [3, 3, 2]])
    np.testing.assert_array_equal(occlusion._highest_neighbour(values, cells), expected)
    assert (occlusion._highest_neighbour(values, np.zeros((2, 3), bool)) == -math.inf).all()


def test_polarised_light_is_weighted_by_microvilli():
    radiance = np.random.default_rng(0).random((2, 3, 4))
    tile = ((optics.Microvilli(20, 9.0), optics.Microvilli(-40, math.inf)),)
    parts = polarization.taken_by(tile, (2, 3), radiance, (0.5, 30.0))
    (light, one), (q, by_q), (u, by_u) = parts
    np.testing.assert_array_equal(light, radiance)
    assert one == 1
    np.testing.assert_allclose(q, 0.5 * radiance * math.cos(math.radians(60)))
    np.testing.assert_allclose(u, 0.5 * radiance * math.sin(math.radians(60)))
    for weights, turn in ((by_q, math.cos), (by_u, math.sin)):
        even, odd = 0.8 * turn(math.radians(40)), turn(math.radians(-80))
        np.testing.assert_allclose(weights, [[even, odd, even]] * 2)
    ((same, weight),) = polarization.taken_by(None, (2, 3), radiance, None)
    assert same is radiance
    assert weight == 1


@pytest.mark.parametrize("degree", [-0.01, 1.01, np.nan])
def test_degrees_of_polarisation(degree):
    radiance, tile = np.ones((2, 3, 4)), ((optics.Microvilli(),),)
    for good in (0.0, 1.0, [0.1, 0.2], np.ones((3, 4)), np.ones((2, 3, 4))):
        polarization.taken_by(tile, (3, 4), radiance, (good, 0.0))
    with pytest.raises(ValueError, match="polarization's degree"):
        polarization.taken_by(tile, (3, 4), radiance, (degree, 0.0))
    for name, wrong in (("degree", ([0.5, np.nan], 0.0)), ("angle", (0.5, [np.inf, 0.0]))):
        with pytest.raises(ValueError, match=f"polarization's {name} holds NaN or infinity"):
            polarization.taken_by(tile, (3, 4), radiance, wrong)
    with pytest.raises(ValueError, match=r"polarization's angle has shape \(3,\)"):
        polarization.taken_by(tile, (3, 4), radiance, (0.5, [1, 2, 3]))
    for wrong in (0.5, (1, 2, 3)):
        with pytest.raises(ValueError, match=r"polarization = .*: must be \(degree, angle_deg\)"):
            polarization.taken_by(tile, (3, 4), radiance, wrong)
    with pytest.raises(ValueError, match="this eye has no microvilli"):
        polarization.taken_by(None, (3, 4), radiance, (0.5, 0.0))


def test_steep_rays_change_polarised_signals(monkeypatch):
    pupil = optics.Pupil(3e-4)
    monkeypatch.setattr(polarization, "light_spread", lambda pupil: 2 * polarization.ROUND)
    error = 0.62 * 2 * 9 / (9 + 16)
    assert polarization.polarised_error(pupil, 4e-4) == pytest.approx(error)
    polarization.check_rays(pupil, 4e-4, polarization.polarised_error(pupil, 4e-4))
    polarization.check_rays(None, 4e-4, 1e-9)
    sine = 0.6 * math.sqrt(0.1 / error)
    with pytest.raises(AccuracyError, match=rf"behind a pupil of NA 0\.6: .* tolerance = 0\.1 allows NA {sine:.2g}"):
        polarization.check_rays(pupil, 4e-4, 0.1)


@pytest.mark.parametrize(("floor", "limit"), [(0.25, 6.0), (0.0, 8.0), (-1.0, 8.0), (1.5, 0.0), (0.9, 0.8)])
def test_contrast_falls_to_the_noise(monkeypatch, floor, limit):
    def profile(f):
        assert f.shape == (513,)
        return [1 - f / 8]

    monkeypatch.setattr(summary, "mtf", lambda white: SimpleNamespace(profile=profile))
    assert summary._noise_limit(None, 8.0, floor) == pytest.approx(limit)
    monkeypatch.setattr(summary, "mtf", lambda white: SimpleNamespace(profile=lambda f: [0 * f + 1]))
    assert summary._noise_limit(None, 8.0, 0.5) == 8.0


def test_measures_that_are_not_accurate_enough_are_listed():
    def fails(*arguments):
        raise AccuracyError(*arguments)

    unknown = []
    assert summary._known("one", lambda: 5.0, unknown) == 5
    assert math.isnan(summary._known("two", lambda: fails("too coarse"), unknown))
    assert math.isnan(summary._known("three", lambda: fails("too coarse", "set dx=1"), unknown))
    assert unknown == ["two: too coarse", "three: too coarse; of optics.psf(eye.pupil), set dx=1"]


def test_light_that_edges_diffract():
    """A disk diffracts the fraction 1/(π²Rδ) of its light beyond δ. A ring has more edge, and less area."""
    for radius, fraction in ((1e-4, 1e-2), (3e-4, 1e-3)):
        found = visual_kernel._beyond_edge(optics.Pupil(radius), fraction)
        assert found == pytest.approx(1 / (math.pi**2 * radius * fraction))
    ring = visual_kernel._beyond_edge(optics.Pupil(3e-4, aperture=optics.Annulus(0.5)), 1e-3)
    assert ring == pytest.approx(found * 1.5 / 0.75, rel=1e-3)
