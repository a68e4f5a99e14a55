"""Plane-to-plane propagation against waves with a known propagation, and against laws that all waves obey."""

import numpy as np
import pytest
from scipy.special import erf

import optics
from validation import reference

WAVELENGTH = 500e-9


def positions(n, dx):
    return (np.arange(n) - n // 2) * dx


def radii(n, dx):
    return np.hypot(*np.meshgrid(positions(n, dx), positions(n, dx)))


def plateau(n, dx, half_width, edge):
    """Return a profile that is 1 in the middle and has a narrow spectrum."""
    x = positions(n, dx)
    profile = (erf((x + half_width) / edge) - erf((x - half_width) / edge)) / 2
    return profile[:, None] * profile[None, :]


def carrier(z):
    return np.exp(2j * np.pi * z / WAVELENGTH)


class TestGaussian:
    @pytest.mark.parametrize(
        ("waist", "z", "dtype", "bound"),
        [
            (0.6e-6, 1e-6, "float32", 2e-5),
            (0.6e-6, 12e-6, "float32", 2e-5),
            (3e-6, 40e-6, "float32", 2e-5),
            (0.6e-6, 1e-6, "float64", 2e-7),
            (0.6e-6, 12e-6, "float64", 2e-7),
            (3e-6, 40e-6, "float64", 1e-10),
        ],
    )
    def test_exact(self, waist, z, dtype, bound):
        """Grazing light with a relative amplitude of 2e-7 is lost for λ/(πw0) = 0.27, and none for 0.05."""
        dx, n = waist / 6, 64
        out_dx = waist * np.hypot(1, z * WAVELENGTH / (np.pi * waist**2)) / 8
        out = optics.propagate(
            np.exp(-((radii(n, dx) / waist) ** 2)),
            dx=dx,
            wavelength=WAVELENGTH,
            distance=z,
            out_dx=out_dx,
            out_shape=(33, 33),
            tolerance=max(10 * bound, 1e-5 if dtype == "float32" else 1e-9),
            dtype=dtype,
        )
        r = radii(33, out_dx)
        exact = reference.gaussian_field(r, WAVELENGTH, waist, z)
        assert reference.relative_l2(out.u / carrier(z), exact) < bound
        paraxial = reference.gaussian_beam(r, WAVELENGTH, waist, z)
        assert reference.relative_l2(paraxial, exact) > 10 * bound

    @pytest.mark.parametrize("z", [-60e-6, 5e-6, 60e-6])
    def test_paraxial(self, z):
        """Width, curvature and Gouy phase agree in front of and behind the waist."""
        waist, n, dx = 3e-6, 64, 0.5e-6
        out = optics.propagate(
            np.exp(-((radii(n, dx) / waist) ** 2)),
            dx=dx,
            wavelength=WAVELENGTH,
            distance=z,
            method="fresnel",
            tolerance=1e-9,
            dtype="float64",
        )
        beam = reference.gaussian_beam(radii(n, dx), WAVELENGTH, waist, z)
        assert reference.relative_l2(out.u / carrier(z), beam) < 1e-9
        without_gouy = beam * np.exp(1j * np.arctan2(z, np.pi * waist**2 / WAVELENGTH))
        assert reference.relative_l2(without_gouy, beam) > 0.05

    @pytest.mark.parametrize("waist", [100e-9, 160e-9, 250e-9])
    def test_evanescent_power(self, waist):
        n, dx = 256, waist / 8
        out = optics.propagate(
            np.exp(-((radii(n, dx) / waist) ** 2)),
            dx=dx,
            wavelength=WAVELENGTH,
            distance=20e-9,
            tolerance=0.3,
            dtype="float64",
        )
        share = reference.gaussian_evanescent_power(WAVELENGTH, waist)
        # the frequency plane has cells a thirtieth of the spectrum wide
        assert out.evanescent_power == pytest.approx(share, rel=0.02)


class TestPlaneWaves:
    @pytest.mark.parametrize("axis", [0, 1])
    @pytest.mark.parametrize("sine", [-0.6, 0.0, 0.3, 0.6])
    def test_tilted(self, sine, axis):
        """The phase in the middle of the plateau, far from its edges, changes by kz cos θ."""
        n, dx, z = 256, 0.25e-6, 10e-6
        along = np.broadcast_to(positions(n, dx), (n, n)) if axis == 1 else positions(n, dx)[:, None]
        u = plateau(n, dx, 20e-6, 2.5e-6) * np.exp(2j * np.pi * sine / WAVELENGTH * along)
        out = optics.propagate(u, dx=dx, wavelength=WAVELENGTH, distance=z, out_shape=(17, 17), tolerance=1e-4)
        x = positions(17, dx)
        exact = reference.plane_wave(x, z, WAVELENGTH, sine / WAVELENGTH)
        got = out.u[8] if axis == 1 else out.u[:, 8]
        assert reference.relative_l2(got / carrier(z), exact) < 1e-4
        mirrored = reference.plane_wave(x, z, WAVELENGTH, -sine / WAVELENGTH)
        paraxial = np.exp(2j * np.pi * sine / WAVELENGTH * x - 1j * np.pi * z * sine**2 / WAVELENGTH)
        if sine:
            assert reference.relative_l2(mirrored, exact) > 0.5
            assert reference.relative_l2(paraxial, exact) > 0.05

    @pytest.mark.parametrize("sine", [1.6, 2.0])
    def test_evanescent_decay(self, sine):
        """The amplitude is exp(-2πz √(f² - 1/λ²)), and the phase does not change."""
        n, dx = 256, 62.5e-9
        u = plateau(n, dx, 4e-6, 1.4e-6) * np.exp(2j * np.pi * sine / WAVELENGTH * positions(n, dx))
        heights, logs = np.array([0.02e-6, 0.08e-6, 0.16e-6]), []
        for z in heights:
            out = optics.propagate(
                u, dx=dx, wavelength=WAVELENGTH, distance=z, out_shape=(5, 5), tolerance=1e-2, dtype="float64"
            )
            exact = reference.plane_wave(positions(5, dx), z, WAVELENGTH, sine / WAVELENGTH) * carrier(z)
            assert reference.relative_l2(out.u[2], exact) < 1e-2
            logs.append(np.log(np.abs(out.u[2, 2])))
            undamped = exact / np.abs(exact)  # |H| = 1 beyond the cut-off
            assert reference.relative_l2(undamped, exact) > 0.1
        rate = -np.polyfit(heights, logs, 1)[0]
        assert rate == pytest.approx(2 * np.pi * np.sqrt(sine**2 - 1) / WAVELENGTH, rel=5e-3)


class TestTalbot:
    """For a period of 0.8 µm and 500 nm, the Talbot distance is 2.28 µm, and 2.56 µm in paraxial theory."""

    PERIOD, ORDERS = 0.8e-6, {-1: 0.3, 0: 1.0, 1: 0.3}

    def row(self, z, method="auto"):
        n, dx = 192, 0.2e-6
        grating = reference.grating_field(positions(n, dx), 0.0, WAVELENGTH, self.PERIOD, self.ORDERS)
        u = plateau(n, dx, 13e-6, 2e-6) * grating
        out = optics.propagate(
            u, dx=dx, wavelength=WAVELENGTH, distance=z, out_dx=0.1e-6, out_shape=(3, 33), tolerance=1e-3, method=method
        )
        return out.u[1]

    def pattern(self, z):
        return reference.grating_field(positions(33, 0.1e-6), z, WAVELENGTH, self.PERIOD, self.ORDERS)

    @pytest.mark.parametrize("share", [0.25, 0.5, 1.0, 2.0])
    def test_field_at_any_distance(self, share):
        z = share * reference.talbot_distance(self.PERIOD, WAVELENGTH)
        assert reference.relative_l2(self.row(z) / carrier(z), self.pattern(z)) < 1e-3

    def test_image_is_at_the_exact_distance_and_not_at_the_paraxial_one(self):
        start = np.abs(self.pattern(0.0)) ** 2
        exact = reference.talbot_distance(self.PERIOD, WAVELENGTH)
        paraxial = reference.paraxial_talbot_distance(self.PERIOD, WAVELENGTH)
        assert reference.relative_l2(np.abs(self.row(exact)) ** 2, start) < 1e-3
        assert reference.relative_l2(np.abs(self.row(paraxial)) ** 2, start) > 0.1
        # Fresnel's method has its image at the paraxial distance, so the test distinguishes the two theories
        assert reference.relative_l2(np.abs(self.row(paraxial, "fresnel")) ** 2, start) < 1e-3
        assert reference.relative_l2(np.abs(self.row(exact, "fresnel")) ** 2, start) > 0.1


class TestEdges:
    """A square aperture at the Fresnel number 2, which is a product of two slits in Fresnel's theory."""

    HALF, Z, OUT = 10e-6, 100e-6, 1e-6

    def slits(self, half_width=HALF):
        slit = reference.slit_field(positions(41, self.OUT), half_width, WAVELENGTH, self.Z)
        return slit[:, None] * slit[None, :]

    def square(self, samples, method="fresnel"):
        """The number of samples is odd, so that the edges fall midway between samples."""
        u = np.ones((samples, samples))
        settings = {"wavelength": WAVELENGTH, "distance": self.Z, "out_dx": self.OUT, "out_shape": (41, 41)}
        out = optics.propagate(
            u, dx=2 * self.HALF / samples, **settings, method=method, tolerance=2e-2, dtype="float64"
        )
        return out.u / carrier(self.Z)

    def test_sampled_edges_converge_with_the_pitch(self):
        samples = (41, 81, 161)
        errors = [reference.relative_l2(self.square(n), self.slits()) for n in samples]
        assert -2.4 < reference.order_of_convergence(samples, errors) < -0.8
        assert errors[-1] < 5e-3
        assert reference.relative_l2(self.slits(1.02 * self.HALF), self.slits()) > 5 * errors[-1]

    def test_exact_propagation_differs_by_little_here(self):
        """Fresnel's phase error kzθ⁴/8 matters only at θ = 0.3, where there is little power."""
        exact = self.square(161, "angular_spectrum")
        assert reference.relative_l2(np.abs(exact), np.abs(self.slits())) < 5e-2
        x = positions(41, self.OUT)
        sinc = np.sinc(2 * self.HALF * x / (WAVELENGTH * self.Z)) * 2 * self.HALF / np.sqrt(WAVELENGTH * self.Z)
        assert reference.relative_l2(np.abs(sinc[:, None] * sinc), np.abs(self.slits())) > 0.2

    def test_a_wide_screen_shows_the_knife_edge(self):
        """Within 6 µm of one edge, the other edge 80 µm away has no effect. The error falls like pitch²."""
        width, z, pitches, errors = 80e-6, 20e-6, (0.5e-6, 0.25e-6, 0.125e-6), []
        for dx in pitches:
            n, m = int(width / dx), int(40e-6 / dx) | 1
            u = np.ones((m, n)) * plateau(m, dx, 14e-6, 2e-6)[:, m // 2, None]
            settings = {"dx": dx, "wavelength": WAVELENGTH, "distance": z, "out_dx": 0.5e-6, "out_shape": (1, 160)}
            out = optics.propagate(u, **settings, method="fresnel", tolerance=3e-4, dtype="float64")
            x = positions(160, 0.5e-6) + (n // 2 + 0.5) * dx  # from the left edge, half a sample before the first
            near = x < 6e-6
            edge = reference.knife_edge_field(x[near], WAVELENGTH, z)
            errors.append(reference.relative_l2(out.u[0, near] / carrier(z), edge))
        assert errors[-1] < 2e-3
        assert reference.order_of_convergence(pitches, errors) > 1.7
        shifted = reference.knife_edge_field(x[near] + 0.25e-6, WAVELENGTH, z)  # half a sample off
        assert reference.relative_l2(shifted, edge) > 0.05


class TestNothingComesBack:
    """Light that leaves the window must not wrap around into it; the reference is a sum over samples."""

    @pytest.mark.parametrize(("sine", "z"), [(0.5, 60e-6), (0.6, 40e-6), (0.8, 20e-6), (0.8, 40e-6), (0.9, 40e-6)])
    @pytest.mark.parametrize("tolerance", [1e-2, 1e-3])
    def test_an_oblique_beam_beside_a_straight_one(self, sine, z, tolerance):
        n, dx = 64, 0.2e-6
        beam = np.exp(-((radii(n, dx) / 2e-6) ** 2))
        u = beam * (0.3 + np.exp(2j * np.pi * sine / WAVELENGTH * positions(n, dx)))
        settings = {"dx": dx, "wavelength": WAVELENGTH, "distance": z, "dtype": "float64"}
        exact = np.array([self.direct(u, x, dx, z) for x in positions(n, dx)])
        try:
            out = optics.propagate(u, **settings, tolerance=tolerance)
        except optics.AccuracyError:
            assert sine * tolerance < 1e-3  # only this little light at grazing angles may be refused
            return
        assert reference.relative_l2(np.abs(out.u[n // 2]) ** 2, np.abs(exact) ** 2) < tolerance

    def direct(self, u, x, dx, z):
        """Return the first Rayleigh-Sommerfeld integral as a sum, whose aliases are evanescent."""
        n, k = len(u), 2 * np.pi / WAVELENGTH
        d = np.sqrt((positions(n, dx)[None, :] - x) ** 2 + positions(n, dx)[:, None] ** 2 + z**2)
        return np.sum(u * z / (2 * np.pi * d**2) * (1 / d - 1j * k) * np.exp(1j * k * d)) * dx**2


class TestLaws:
    def random(self, n, seed):
        rng = np.random.default_rng(seed)
        coarse = rng.normal(size=(2, n, n)) * np.exp(-((radii(n, 1 / n) / 0.15) ** 2))
        return coarse[0] + 1j * coarse[1]

    def test_parseval(self):
        """A window that contains all light has all power except for the evanescent part."""
        n, dx = 64, 0.2e-6  # frequencies up to 1.25/λ along an axis
        u = self.random(n, 1)
        spectrum = np.abs(np.fft.fft2(u, (1024, 1024))) ** 2
        f = np.fft.fftfreq(1024, dx)
        evanescent = spectrum[np.hypot(f[None, :], f[:, None]) >= 1 / WAVELENGTH].sum() / spectrum.sum()
        out = optics.propagate(
            u, dx=dx, wavelength=WAVELENGTH, distance=2e-6, out_shape=(512, 512), tolerance=0.45, dtype="float64"
        )
        assert evanescent > 0.05
        assert out.evanescent_power == pytest.approx(evanescent, rel=0.01)
        arrived = np.sum(np.abs(out.u) ** 2) / np.sum(np.abs(u) ** 2)
        # grazing light leaves even this window
        assert arrived == pytest.approx(1 - evanescent, abs=0.02)
        assert abs(1 - arrived) > 0.03  # |H| = 1 everywhere would preserve it all

    def test_reciprocity(self):
        """For propagators P, Q and a screen t, ∫ v (P t Q u) = ∫ u (Q t P v).

        A kernel shifted by half a sample, or one that is not even, breaks it.
        """
        n, dx = 48, 0.5e-6
        u, v, screen = (self.random(n, seed) for seed in (2, 3, 4))
        settings = {"dx": dx, "wavelength": WAVELENGTH, "tolerance": 1e-6, "dtype": "float64"}

        def through(field, first, second):
            return optics.propagate(
                optics.propagate(field, distance=first, **settings).u * screen, distance=second, **settings
            ).u

        there, back = np.sum(v * through(u, 30e-6, 50e-6)), np.sum(u * through(v, 50e-6, 30e-6))
        assert abs(there - back) < 1e-6 * abs(there)
        shifted = np.sum(np.roll(u, 1, axis=1) * through(v, 50e-6, 30e-6))
        assert abs(shifted - there) > 1e-2 * abs(there)

    def test_reciprocity_of_source_and_sensor(self):
        """z² PSF(s -> z) = s² PSF(z -> s) on a lens's axis, with deviations proportional to the aperture squared."""
        errors, apertures = [], (0.05, 0.1, 0.2)
        for aperture in apertures:
            f = 20 * WAVELENGTH / aperture**2
            pupil = optics.Pupil(aperture * f, thin_lens_focal_length=f)
            near, far = 1.35 * f, 3.1 * f  # out of focus
            peaks = []
            for s, z in ((near, far), (far, near)):
                settings = {"source_distance": s, "dx": 1e-7, "shape": (1, 1), "tolerance": 1e-5, "dtype": "float64"}
                peaks.append(optics.psf(pupil, [WAVELENGTH], z, **settings).psf[0, 0, 0] * z**2)
            errors.append(abs(peaks[0] / peaks[1] - 1))
        assert errors[0] < 2e-2
        assert reference.order_of_convergence(apertures, errors) == pytest.approx(2, abs=0.3)
