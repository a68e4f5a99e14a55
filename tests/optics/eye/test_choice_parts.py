"""Choices of nodes and bands, densities, patches and pixels, from given numbers."""

import math
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

import optics
from optics import AccuracyError, Eye
from optics.eye import band_choice, kernel_bank, patch, receptor_density, sensor_pixels
from optics.eye.band_choice import choose_bands
from optics.eye.kernel_interpolation import NodeChoice, worst_difference
from optics.eye.receptor_lattice import ReceptorLattice
from optics.eye.retina import more_time
from optics.numerics.grid import Grid


@pytest.mark.parametrize("samples", [1, 2, 3])
def test_the_worst_scene_lights_one_sign(samples):
    """The receptive field is the kernel, convolved with the mean over the receptor."""
    rng = np.random.default_rng(0)
    terms = [(1.5, rng.random((2, 3, 5))), (-1.0, rng.random((2, 5, 3))), (-0.5, rng.random((2, 1, 1)))]
    total = np.zeros((2, 5, 5))
    total[:, 1:4] += 1.5 * terms[0][1]
    total[:, :, 1:4] -= terms[1][1]
    total[:, 2:3, 2:3] -= 0.5 * terms[2][1]
    fields = []
    for band in total:
        for _ in range(2):
            band = np.stack([np.convolve(row, np.ones(samples) / samples) for row in band]).T
        fields.append(band)
    sums = [np.maximum(sign * field, 0).sum() for field in fields for sign in (1, -1)]
    assert worst_difference(terms, samples) == pytest.approx(max(sums))
    assert worst_difference([(-weight, kernel) for weight, kernel in terms], samples) == pytest.approx(max(sums))


def test_errors_between_nodes():
    """The kernel is x² + 2 y², whose linear interpolation between the nodes -1, 0 and 1 errs by 1/4 + 2/4."""
    asked = []

    def kernel_at(place):
        asked.append(place)
        return np.full((1, 1, 1), place[0] ** 2 + 2 * place[1] ** 2)

    choice = NodeChoice("field", kernel_at, [(3, 3)], 1, white=lambda: 0.5)
    assert choice.error((3, 3)) == pytest.approx(0.75 / 0.5)
    assert choice.error((3, 1)) == pytest.approx(0.25 / 0.5)
    assert len(set(asked)) == len(asked) == 9 + 4 + 2
    assert NodeChoice("field", lambda at: np.ones((1, 1, 1)), [(3,)], 1, white=lambda: 1 / 0).error((3,)) == 0


@pytest.mark.parametrize(
    ("counts", "layers", "field"),
    [
        ((3, 1), [3.0, 2.0, 1.5], (1, 1)),
        ((2, 3), [3.0, 1.5], (2, 3)),
        (("distinct", 1), [3.0, 2.5, 1.5], (1, 1)),
        (("auto", "auto"), [2.0], (1, 1)),
    ],
)
def test_kernels_of_a_bank(counts, layers, field):
    """Distances of 1.5, 2.5 and 3: the middle in 1/z is 2. The retina of 2 x 3 receptors has 4 cells for each."""
    different = counts[0] != "auto"

    def kernel_at(z, right, down):
        return np.full((1, 1, 1), different * (100 * z + 10 * right + down))

    bank = kernel_bank.prepare(kernel_at, (2, 3), 2, np.array([2.5, 1.5, 3.0]), counts, 0.1)
    assert [choice.counts for choice in bank.choices] == [(len(layers),), field]
    assert (bank.field, bank.averaged, bank.parallax) == ((2.0, 3.0), True, 0)
    assert bank.inverse_distances == pytest.approx(tuple(1 / z for z in layers))
    rows, columns = (np.linspace(-1, 1, n) if n > 1 else [0.0] for n in field)
    places = [(i, j, k) for i in range(len(layers)) for j in range(field[0]) for k in range(field[1])]
    assert list(bank.kernels) == places
    for i, j, k in places:
        assert bank.kernels[i, j, k].item() == pytest.approx(different * (100 * layers[i] + 10 * columns[k] + rows[j]))


def test_bands_of_coloured_surfaces(monkeypatch):
    """The fewest bands for which the error of colours is within the tolerance, without kernels."""
    errors = {1: 0.4, 2: 0.2, 4: 0.1, 8: 0.04, 16: 0.02, 32: 0.01}
    limits = optics.receptors_of("rgb").limits_nm

    def error(chosen, exact, range_nm):
        assert (len(exact.wavelengths), range_nm) == (band_choice.FINEST, limits)
        return errors[len(chosen.wavelengths)]

    monkeypatch.setattr(band_choice, "_reflectance_error", error)
    for tolerance, bands in ((0.4, 1), (0.399, 2), (0.1, 4), (0.04, 8), (0.02, 16), (0.01, 32), (0.5, 1)):
        assert len(choose_bands(tolerance).wavelengths) == bands
    with pytest.raises(AccuracyError, match=r"^tolerance = 0\.009: 32 bands leave a predicted error of 1\.0e-02 of"):
        choose_bands(0.009)
    for wrong in (0.9e-6, 0.51):
        with pytest.raises(ValueError, match=r"^tolerance = "):
            choose_bands(wrong)


@pytest.mark.parametrize(("white", "scale"), [(None, 1.0), (0.5, 0.5)])
def test_bands_of_kernels(monkeypatch, white, scale):
    """The errors of colours and of kernels add up. Each number of bands is compared with twice as many."""
    errors, asked, computed = {1: 0.41, 2: 0.1, 4: 0.05, 8: 0.02, 16: 0.02, 32: 0.02}, [], []
    worst = {2: 0.3, 4: 0.06, 8: 0.03, 16: 0.0, 32: 0.0}

    def difference(terms, samples):
        (one, _), (minus, _) = terms
        assert (one, minus, samples) == (1, -1, 3)
        counts = len(computed[-2]), len(computed[-1])
        asked.append(counts)
        assert counts[1] == 2 * counts[0]
        return worst[counts[0]] * scale

    def kernels(wavelengths):
        computed.append(wavelengths)
        return np.ones((len(wavelengths), 1, 1))

    monkeypatch.setattr(
        band_choice, "_reflectance_error", lambda chosen, exact, range_nm: errors[len(chosen.wavelengths)]
    )
    monkeypatch.setattr(band_choice, "worst_difference", difference)
    for tolerance, bands, comparisons in ((0.4, 2, [2]), (0.111, 4, [2, 4]), (0.1, 8, [2, 4, 8]), (0.03, 16, [8, 16])):
        asked.clear()
        computed.clear()
        found = choose_bands(tolerance, "rgb", kernels, 3, white)
        assert len(found.wavelengths) == bands
        assert [count for count, _ in asked] == comparisons
        assert [len(wavelengths) for wavelengths in computed] == [comparisons[0], *(2 * n for n in comparisons)]


def test_a_cell_for_each_receptor_is_the_default(monkeypatch):
    """Bands are first chosen for colours; white is what the kernels transmit."""
    asked = []
    monkeypatch.setattr(band_choice, "_reflectance_error", lambda chosen, exact, range_nm: 0.0)
    monkeypatch.setattr(band_choice, "worst_difference", lambda terms, samples: asked.append(samples) or 0.0)
    assert len(choose_bands(0.1, kernels=lambda at: np.ones((len(at), 1, 1))).wavelengths) == 1
    assert asked == [1]


def test_numbers_of_nodes_to_try(monkeypatch):
    """The field of 8 x 16 receptors has half as many intervals between rows as between columns."""
    tried = {}

    def made(stage, kernel_at, candidates, mean, white):
        tried[stage] = candidates, mean, white()
        return NodeChoice(stage, lambda at: np.ones((1, 1, 1)), candidates, mean)

    monkeypatch.setattr(kernel_bank, "NodeChoice", made)
    given = Mock(return_value=np.ones((1, 1, 1)))
    kernel_bank.prepare(given, (8, 16), 3, np.array([1.0, 2.0]), ("auto", "auto"), 0.1)
    assert tried["depth"] == ([(1,), (3,), (5,), (9,), (17,), (33,)], 3, 1.0)
    assert tried["field"] == ([(1, 1), (2, 3), (3, 5), (5, 9)], 3, 1.0)
    kernel_bank.prepare(given, (8, 16), 3, 1.0, ("auto", "auto"), 0.1, mean=2, white=lambda: 0.5)
    assert tried["depth"][1:] == (2, 0.5)


def test_errors_of_colours():
    """Half of the largest error of Σ w d exp(2πi λ/Λ), where Λ is the range of wavelengths, here 200 nm."""
    one = SimpleNamespace(weights=np.array([[0.5], [0.1]]), wavelengths=np.array([500e-9]))
    two = SimpleNamespace(weights=np.array([[0.2, 0.3], [0.1, 0.0]]), wavelengths=np.array([450e-9, 550e-9]))
    light = [band_choice.daylight(bands.wavelengths) for bands in (one, two)]
    phase = [np.exp(2j * math.pi * bands.wavelengths * 1e9 / 200) for bands in (one, two)]
    sums = [bands.weights @ (d * p) for bands, d, p in zip((one, two), light, phase, strict=True)]
    expected = max(abs(a - b) for a, b in zip(*sums, strict=True)) / 2
    assert band_choice._reflectance_error(one, two, (400, 600)) == pytest.approx(expected)


def test_advice_on_the_time_limit():
    with (
        pytest.raises(AccuracyError, match=r"^slow; most_seconds=23 allows the eye this time$") as refused,
        more_time(),
    ):
        raise AccuracyError("slow", seconds=20.5)
    assert refused.value.seconds == 20.5
    with pytest.raises(AccuracyError, match=r"^coarse$"), more_time():
        raise AccuracyError("coarse")


@pytest.mark.parametrize(
    ("resolution", "counts"), [((1, 64), (512, 512)), ((65, 256), (520, 2048)), ((257, 10), (2048, 512))]
)
def test_cells_on_which_a_density_is_evaluated(resolution, counts):
    """Angles are those of the cells' middles. The field is 2 · 0.5 high and 2 · 0.75 wide around (0.25, -0.5)."""
    asked = []

    def density(right, up):
        asked.append((right, up))
        return 2 + 0 * right

    found = receptor_density.density_on(density, resolution, (0.5, 0.75), (0.25, -0.5))
    assert found.shape == counts
    (right, up) = asked[0]
    rows, columns = counts
    x = 0.25 + 0.75 * ((np.arange(columns) + 0.5) * 2 / columns - 1)
    y = -0.5 + 0.5 * ((np.arange(rows) + 0.5) * 2 / rows - 1)
    np.testing.assert_allclose(np.tan(np.radians(right[3])), x)
    np.testing.assert_allclose(np.tan(np.radians(up[:, 5])), -y)


def test_densities_of_a_fovea_and_a_streak():
    """The density per angle is multiplied by cos² of the angle, because the retina is flat."""
    right, up = np.array([10.0, -20.0]), np.array([-5.0, 15.0])
    flat = np.cos(np.radians(right)) ** 2 * np.cos(np.radians(up)) ** 2
    found = optics.Fovea(4.0, (2.0, -1.0))(right, up)
    np.testing.assert_allclose(found, flat / (1 + np.array([8, 22]) / 4) / (1 + np.array([4, 16]) / 4))
    streak = optics.VisualStreak(4.0, 3.0)(right, up)
    np.testing.assert_allclose(streak, flat / (1 + np.array([8, 12]) / 4))
    assert (optics.Fovea().e2_deg, optics.Fovea().center_deg) == (1.04, (0.0, 0.0))
    assert (optics.VisualStreak().e2_deg, optics.VisualStreak().elevation_deg) == (5.0, 0.0)


def test_maps_of_densities():
    values = np.arange(1.0, 7).reshape(2, 3)
    density = receptor_density.density_of(values)
    assert receptor_density.density_of(density) is density
    assert receptor_density.density_of(None) is None
    np.testing.assert_array_equal(receptor_density.density_on(density, (9, 9), (1.0, 1.0), (0.0, 0.0)), values)
    same = receptor_density.density_of(values.copy())
    assert density == same
    assert hash(density) == hash(same)
    assert density != receptor_density.density_of(values.reshape(3, 2))
    assert density != 3
    assert receptor_density.density_of(np.ones((1, 2048))).values.shape == (1, 2048)
    assert receptor_density.density_of(np.ones((1, 2), int)).values.dtype == float
    unhashable = type("Unhashable", (), {"__call__": lambda self, right, up: right, "__hash__": None})()
    for wrong in (unhashable, optics.Fovea, "fovea", 2.0, np.ones((2, 2, 2)), np.ones((0, 2)), np.ones((2049, 1))):
        with pytest.raises(ValueError, match=r"^density (=|has)"):
            receptor_density.density_of(wrong)
    for wrong, reason in ((-1.0, "is -1 at its smallest"), (0.0, "is 0 at its"), (np.inf, "holds NaN or infinity")):
        with pytest.raises(ValueError, match=f"^density {reason}"):
            receptor_density.density_of(np.array([[1.0, wrong]]))


LATTICE = ReceptorLattice(np.array([-1.0, 0.4, 1.0]), np.array([[-2.0, -1, 0, 1.5, 2], [-2.0, -1.2, 0.6, 1, 2]]))
EYE = Eye(
    resolution=(2, 4),
    fov_deg=90.0,
    sensor_width=2e-4,
    vertical_fov_deg=2 * math.degrees(math.atan(0.6)),
    density=LATTICE,
)


@pytest.mark.parametrize(
    ("at", "height", "width"),
    [
        ((0.1, 0.1), 1.4, 1.5),  # in units of the average receptor, right and down from the middle of the field
        ((-2, -1), 1.4, 1.0),
        ((0.5, 0.5), 0.6, 1.8),
        ((2, 1), 0.6, 1.0),
        ((0.8, 0.9), 0.6, 0.4),
    ],
)
def test_an_eye_with_a_single_receptor(at, height, width):
    """An average receptor is 6e-5 high and 5e-5 wide; the focal length is 1e-4."""
    right, down = at[0] * 0.5, at[1] * 0.6
    direction = math.degrees(math.atan(right)), -math.degrees(math.atan(down))
    one = patch.receptor_in(EYE, direction)
    assert (one.resolution, one.density, one.full_aperture) == ((1, 1), None, 2e-4)
    assert one.receptor_size == pytest.approx((height * 6e-5, width * 5e-5))
    assert one.sensor_distance == pytest.approx(1e-4)
    assert one.eccentricity_deg == pytest.approx(direction)


def test_patches_around_other_directions():
    aside = Eye(resolution=(2, 4), fov_deg=90.0, sensor_width=2e-4, eccentricity_deg=(20.0, -10.0))
    middle = patch.receptor_in(aside, None)
    assert (middle.eccentricity_deg, middle.receptor_size) == ((20.0, -10.0), pytest.approx((5e-5, 5e-5)))
    x, y = math.tan(math.radians(20)), math.tan(math.radians(10))
    for sign in (-1, 1):  # the field is 2 · 1 wide and 2 · 0.5 high
        for wide, high in ((1.0, 0.5), (1 + 1e-6, 0.0), (0.0, 0.5 + 1e-6)):
            direction = tuple(math.degrees(math.atan(at)) for at in (x + sign * wide, -y + sign * high))
            if wide <= 1 and high <= 0.5:
                assert patch.receptor_in(aside, direction).eccentricity_deg == direction
                continue
            with pytest.raises(
                ValueError, match=r"must lie in the field, 90 x 53\.13 degrees around \(20\.0, -10\.0\)"
            ):
                patch.receptor_in(aside, direction)
    across, down = patch.spacing_range(EYE)
    high, wide = EYE.receptor_angles_deg
    assert (across, down) == ((wide.min(), wide.max()), (high.min(), high.max()))


@pytest.mark.parametrize("shape", [(3, 4), (4, 3)])
@pytest.mark.parametrize("cutoff", [0.5, 3.0])
def test_means_over_pixels(shape, cutoff):
    """Means of cos(2πfx + φ) over a pixel of the side a are sinc(fa) times the value at its middle."""
    window = Grid(shape, 0.5, (1.0, -2.0))
    pixels = sensor_pixels.SensorPixels.around(window, cutoff, 1e-4)
    assert pixels.samples.dx == pytest.approx(min(0.5, 1 / (3.1 * cutoff)))
    for matrix, at, middles in (
        (pixels.rows, pixels.samples.y, window.y),
        (pixels.columns, pixels.samples.x, window.x),
    ):
        f = 0.9 * cutoff
        expected = np.sinc(0.5 * f) * np.cos(2 * math.pi * f * middles + 0.4)
        np.testing.assert_allclose(matrix @ np.cos(2 * math.pi * f * at + 0.4), expected, atol=1e-3)
        beyond = (abs(at - middles.mean()).max() - len(middles) * 0.25) / pixels.samples.dx
        assert 8 - 1e-9 <= beyond < 9 - 1e-9
