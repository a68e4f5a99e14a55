"""Levels of depth and field: each is compared with the more exact one, and errors are predicted in advance."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from optics import BSplineRelief, Eye, Pupil, Waveguide
from optics.eye.eye import LIGHT_FROM
from optics.eye.kernel_bank import KernelBank

S = 2
NEAR, FAR = 0.6e-3, 5e-3
LENS = Eye(Pupil(25e-6, thin_lens_focal_length=Eye().sensor_distance), (7, 9), bands=1)


def flat_scene(rng, eye, margin=4):
    h, w = (n * S + margin for n in eye.resolution)
    return rng.random((eye.bands, h, w))


def reference(eye, radiance, kernel_of):
    """Return signals for which every cell of the scene is spread by its own kernel."""
    total = np.zeros((eye.bands, *radiance.shape[1:]))
    height, width = radiance.shape[1:]
    for i, j in np.ndindex(height, width):
        kernel = kernel_of(i, j)
        half = kernel.shape[-1] // 2
        padded = np.zeros((eye.bands, height + 2 * half, width + 2 * half))
        padded[:, i : i + 2 * half + 1, j : j + 2 * half + 1] = kernel * radiance[:, i : i + 1, j : j + 1]
        total += padded[:, half : half + height, half : half + width]
    (h, w), margin = eye.resolution, (height - eye.resolution[0] * S) // 2
    seen = total[:, margin : margin + h * S, margin : margin + w * S].reshape(eye.bands, h, S, w, S).mean(axis=(2, 4))
    return eye.throughput * np.tensordot(eye.spectral_bands.weights, seen, axes=1)


class TestDepth:
    @pytest.fixture(scope="class")
    @staticmethod
    def scene():
        """Return a slanted wall, whose left side is near and whose right side is far."""
        radiance = flat_scene(np.random.default_rng(0), LENS)
        z = np.broadcast_to(1 / np.linspace(1 / NEAR, 1 / FAR, radiance.shape[2]), radiance.shape[1:])
        kernels = {d: LENS.kernel(S, d) for d in np.unique(z)}
        return radiance, z, reference(LENS, radiance, lambda i, j: kernels[z[i, j]])

    def test_error_falls_with_the_square_of_the_layers(self, scene):
        radiance, z, exact = scene
        errors = []
        for layers in (1, 3, 5, 9):
            bank = LENS.sight(S, z, layers, light_from="centres")
            assert len(bank.kernels) == layers
            errors.append(np.abs(LENS.see(radiance, S, z=z, sight=bank) - exact).max() / LENS.throughput)
        assert errors[0] > 0.03
        assert np.log2(errors[1] / errors[2]) > 1.5
        assert errors[3] < errors[0] / 20

    @pytest.mark.parametrize("tolerance", [0.3, 0.05, 0.01])
    def test_predicted_error_holds_and_is_not_cowardly(self, scene, tolerance):
        radiance, z, exact = scene
        bank = LENS.sight(S, z, tolerance=tolerance, light_from="centres")
        (layers,), predicted = bank.choices[0].counts, bank.choices[0].predicted_error
        assert predicted <= tolerance
        weight = LENS.spectral_bands.weights.max()  # scene cells reach 1 here, not white daylight
        actual = np.abs(LENS.see(radiance, S, z=z, sight=bank) - exact).max() / LENS.throughput
        assert actual <= predicted * max(weight, 1)
        assert layers <= {0.3: 3, 0.05: 5, 0.01: 9}[tolerance]

    def test_one_distance_is_one_kernel(self):
        bank = LENS.sight(S, 2e-3)
        assert len(bank.kernels) == 1
        assert bank.choices[0].predicted_error == 0
        rng = np.random.default_rng(0)
        scene = flat_scene(rng, LENS)
        everywhere = np.full(scene.shape[1:], 2e-3)
        np.testing.assert_array_equal(LENS.see(scene, S, z=everywhere), LENS.see(scene, S, z=2e-3))

    def test_far_scenes_need_one_layer(self):
        """Light from 10 m and more is practically parallel, R² / (2 z λ) = 6e-5."""
        bank = LENS.sight(S, (10.0, math.inf))
        assert bank.choices[0].counts == (1,)
        assert bank.choices[0].predicted_error < 1e-3

    def test_a_wrong_depth_is_noticed(self, scene):
        radiance, z, exact = scene
        error = (
            np.abs(LENS.see(radiance, S, z=z[:, ::-1], sight=LENS.sight(S, z, 9, light_from="centres")) - exact).max()
            / LENS.throughput
        )
        assert error > 0.03


class TestField:
    WIDE = Eye(Pupil(30e-6, thin_lens_focal_length=240e-6), (1, 15), 45.0, bands=1)

    def test_light_from_the_side_lands_on_its_geometric_image(self):
        """For a slow ideal lens, the off-axis kernel is centred on the direction in all four quadrants."""
        eye = Eye(Pupil(8e-6, thin_lens_focal_length=Eye().sensor_distance), bands=1)
        for direction in ((10, 0), (0, 10), (-15, 5), (12, -12)):
            kernel = eye.kernel(8, direction_deg=direction)[0]
            at = np.arange(len(kernel)) - len(kernel) // 2
            centre = np.array([kernel.sum(axis=1) @ at, kernel.sum(axis=0) @ at]) / kernel.sum()
            assert np.abs(centre).max() < 0.3
            assert kernel.sum() == pytest.approx(1, abs=0.02)

    def test_a_prism_turns_light_from_its_side_onto_the_axis(self):
        """A relief that is thicker in its last columns deflects light towards +x. The kernel of a tilted source alone
        would not have the expected shift.
        """
        ramp = 0.1 / 0.5 * (2 * np.arange(4) - 3) * 15e-6
        eye = Eye(Pupil(15e-6, BSplineRelief(np.broadcast_to(ramp, (4, 4)))), bands=1)

        def shift(direction):
            kernel = eye.kernel(4, direction_deg=direction)[0]
            return kernel.sum(axis=0) @ (np.arange(len(kernel)) - len(kernel) // 2) / kernel.sum()

        cell = eye.receptor_pitch / 4 / eye.sensor_distance
        for degrees in (-15, 0, 15):
            tangent = math.tan(math.radians(degrees))
            sine = 0.1 + math.sin(math.radians(degrees))  # towards +x; light from the right also travels to +x
            image = sine / math.sqrt(1 - sine**2)
            assert shift((degrees, 0)) == pytest.approx((image - tangent) / cell, abs=1.0)

    @pytest.mark.slow
    def test_error_falls_with_the_zones(self):
        eye = self.WIDE
        radiance = flat_scene(np.random.default_rng(3), eye, margin=0)
        height, width = radiance.shape[1:]
        cell = eye.receptor_pitch / S / eye.sensor_distance

        @cache
        def corner(right, down):
            return eye.kernel(S, direction_deg=tuple(math.degrees(math.atan(t)) for t in (right, -down)))

        def kernel_of(i, j):
            """Return the kernel of a symmetric eye, a mirrored kernel of one quadrant."""
            right, down = (j - (width - 1) / 2) * cell, (i - (height - 1) / 2) * cell
            return corner(abs(right), abs(down))[:, :: (1 if down > 0 else -1), :: (1 if right > 0 else -1)]

        exact = reference(eye, radiance, kernel_of)
        errors = []
        for zones in (1, 3, 5, 9):
            seen = eye.see(radiance, S, sight=eye.sight(S, field_zones=zones, light_from="centres"))
            errors.append(np.abs(seen - exact).max() / eye.throughput)
        assert errors[0] > 0.02
        assert errors == sorted(errors, reverse=True)
        assert errors[3] < errors[0] / 8

    def test_predicted_error_is_within_the_tolerance_and_printed(self):
        bank = self.WIDE.sight(S, field_zones="auto", tolerance=0.1)
        depth, wide = bank.choices
        assert wide.stage == "field"
        assert 0 < wide.predicted_error <= 0.1
        assert math.prod(wide.counts) == len(bank.kernels) > 1
        assert "tolerance of 0.1" in str(bank)
        assert len(str(bank).splitlines()) == 2
        assert depth.counts == (1,)

    def test_mirror_images(self):
        """A symmetric eye gives mirrored signals for a mirrored scene, including the zones."""
        eye = self.WIDE
        scene = flat_scene(np.random.default_rng(1), eye)
        bank = eye.sight(S, field_zones=3)
        there = eye.see(scene, S, sight=bank)
        back = eye.see(scene[:, ::-1, ::-1], S, sight=bank)[:, ::-1, ::-1]
        np.testing.assert_allclose(back, there, atol=2e-3 * there.max())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"z": -1.0}, "z = -1"),
        ({"z": [-1e-3, 1e-3]}, r"^z = .*: must be"),
        ({"z": [0.0, 1.0]}, r"^z = .*: must be"),
        ({"z": []}, "z is empty"),
        ({"z": [1.0, math.nan]}, "z is empty or holds NaN"),
        ({"z": "far"}, "z = 'far'"),
        ({"depth_layers": 0}, r"depth_layers = 0: must be a whole number in \[1, 64\]"),
        ({"depth_layers": "many"}, "depth_layers = 'many'"),
        ({"field_zones": 2.5}, "field_zones = 2.5"),
        ({"tolerance": 0.0}, "tolerance = 0"),
    ],
)
def test_bad_sights(arguments, message):
    with pytest.raises(ValueError, match=message):
        LENS.sight(S, **arguments)


def test_a_sight_of_another_eye():
    bank = Eye().sight(S)
    assert isinstance(bank, KernelBank)
    with pytest.raises(ValueError, match="sight is for a retina of 30 x 30 cells"):
        LENS.see(np.zeros((1, 14, 18)), S, sight=bank)
    with pytest.raises(ValueError, match="sight is for 2 bands: must be for 1, as the eye has"):
        LENS.see(np.zeros((1, 14, 18)), S, sight=replace(LENS, bands=2).sight(S))
    with pytest.raises(ValueError, match="sight is for an eye without waveguides: must be for one with"):
        replace(LENS, waveguide=Waveguide(2e-6)).see(np.zeros((1, 14, 18)), S, sight=LENS.sight(S))


def test_depths_of_another_shape():
    with pytest.raises(ValueError, match="z has shape"):
        LENS.see(np.zeros((1, 14, 18)), S, z=np.full((3, 4), 1.0) + np.arange(4))


@pytest.mark.parametrize("direction", [(90.0, 0.0), (0.0, math.nan)])
def test_bad_directions(direction):
    with pytest.raises(ValueError, match="direction_deg"):
        LENS.kernel(S, direction_deg=direction)


class TestLightFrom:
    """Light comes from the whole area of a scene's cells, so signals do not depend on the scene's resolution."""

    def stripes(self, s):
        height, width = LENS.resolution
        return np.broadcast_to((np.arange(width * s) // s + 1) % 2, (1, height * s, width * s)).astype(float)

    def test_a_picture_cut_finer_is_the_same_picture(self):
        seen = [LENS.see(self.stripes(s), s) for s in (1, 2, 4, 8)]
        for one in seen[1:]:
            np.testing.assert_allclose(one, seen[0], atol=1e-4 * LENS.throughput)

    def test_stripes_are_what_the_diffraction_limit_leaves_of_them(self):
        """The reference is a sum over harmonics, with Airy's OTF (Goodman, eq. 6-32) and the receptor's transform."""
        eye = replace(LENS, resolution=(41, 41), sensor_width=41 / 9 * LENS.sensor_width, tolerance=1e-3)
        eye = replace(eye, fov_deg=math.degrees(2 * math.atan(eye.sensor_width / 2 / LENS.sensor_distance)))
        assert eye.sensor_distance == pytest.approx(LENS.sensor_distance)
        scene = np.broadcast_to((np.arange(41) + 1) % 2, (1, 41, 41)).astype(float)
        bright, dark = eye.see(scene, 1)[0, 20, 20:22] / eye.throughput / eye.spectral_bands.weights[0, 0]
        cutoff = 50e-6 / (550e-9 * eye.sensor_distance) * eye.receptor_pitch
        contrast = 0.0
        for harmonic in range(1, math.ceil(2 * cutoff), 2):
            s = harmonic / 2 / cutoff
            otf = 2 / math.pi * (math.acos(s) - s * math.sqrt(1 - s * s))
            contrast += otf * 2 * (2 / math.pi / harmonic) ** 2
        assert bright - dark == pytest.approx(contrast, abs=2e-3)
        centres = eye.see(scene, 1, sight=eye.sight(1, light_from="centres"))[0, 20, 20:22] / eye.throughput
        assert np.diff(centres)[0] / eye.spectral_bands.weights[0, 0] < -contrast - 0.03, "points differ"

    def test_detail_within_cells_is_better_put_at_their_centres(self):
        """Smooth waves are given as means over cells. Errors fall with the square of the cell size if cells resolve the
        PSF. Light from the centres of cells always has less than half the error.
        """
        eye = replace(LENS, tolerance=1e-4)
        height, width = eye.resolution
        fine = self.waves(32)
        exact, errors = eye.see(fine, 32), []
        for s in (2, 4, 8):
            means = fine.reshape(1, height * s, 32 // s, width * s, 32 // s).mean(axis=(2, 4))
            seen = [eye.see(means, s, sight=eye.sight(s, light_from=light_from)) for light_from in LIGHT_FROM]
            errors.append([np.abs(one - exact)[0, 1:-1, 1:-1].max() for one in seen])
        cells, centres = np.transpose(errors)
        assert 1.3 < np.log2(cells[1] / cells[2]) < 2.3
        assert (centres < cells / 2).all()

    def waves(self, s):
        down, across = ((np.arange(n * s) + 0.5) / s for n in LENS.resolution)
        return (0.5 + 0.25 * (np.sin(2.3 * across) + np.cos(1.7 * down)[:, None]))[None]

    def test_unknown_readings_are_refused(self):
        with pytest.raises(ValueError, match="light_from = 'points': must be one of 'cells', 'centres'"):
            LENS.sight(S, light_from="points")
