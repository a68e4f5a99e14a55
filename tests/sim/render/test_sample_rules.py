"""Rules that choose samples and levels, from given errors: every limit, cost and reason."""

import math
from types import SimpleNamespace

import pytest

import optics
import sim
from sim.eyes.depth_layers import ONE_PSF
from sim.eyes.sampling import BoxSampling
from sim.render.fidelity import Level
from sim.render.fidelity_choice import Samples, Shares, cheapest
from sim.render.fidelity_stages import CAUTION
from sim.render.sample_choice import PUPIL_RAYS, fewest_samples

EYE = sim.Eyes(n_eyes=1, resolution=(5, 5)).eye()
BEHIND_A_PUPIL = sim.Eyes(n_eyes=1, resolution=(5, 5), optics=optics.Pupil(1e-4)).eye()
PERFECT, BLURRED = BoxSampling(EYE), SimpleNamespace(eye=SimpleNamespace(lattice=None))


class Given:
    """Trials whose error is the allowed one, 1, from a given number of samples on, and `before` with fewer.

    rays, areas: that number of rays and of areas; areas None: there are no areas
    shared: numbers of areas below one that receptors may share
    """

    def __init__(self, rays, areas=None, before=(1.01, 1.01), shared=()):
        self.rays, self.areas, self.before, self.shared = rays, areas, before, shared

    def errors(self, sampling, light):
        return lambda n: (1.0 if n >= self.rays else self.before[0]) / CAUTION

    def area_errors(self, sampling, light):
        return lambda n: (1.0 if n >= self.areas else self.before[1]) / CAUTION

    def have_areas(self, *lights):
        return self.areas is not None

    def reflected_more_often(self, sampling):
        return 0.0

    def may_share(self, sampling, number):
        return number in self.shared

    def areas_of_field(self, sampling, areas):
        return areas


def chosen(trials, sampling=PERFECT, light="direct", left_out=0.0):
    allowed = SimpleNamespace(error=1.0, without_light=math.hypot(1.0, left_out))
    return fewest_samples(trials, sampling, Level("light", light, left_out, ""), allowed)


NEVER = math.inf


@pytest.mark.parametrize(
    ("trials", "kind", "number"),
    [
        (Given(3), "rays", 3),  # an area costs three rays
        (Given(3, 1), "rays", 3),
        (Given(4, 1), "areas", 1),
        (Given(4), "rays", 4),
        (Given(12, 4), "rays", 12),
        (Given(16, 4), "areas", 4),
        (Given(64, NEVER), "rays", 64),
        (Given(NEVER, 30), "areas", 30),
    ],
)
def test_the_cheaper_samples_of_perfect_lenses(trials, kind, number):
    found = chosen(trials)
    assert (found.kind, found.number, found.enough) == (kind, number, True)


@pytest.mark.parametrize(
    ("trials", "light", "kind", "number"),
    [
        (Given(1, 1), "direct", "rays", 1),
        (Given(1.5, 1), "direct", "rays", 1.5),  # an area costs 1.6 rays, and 2 in all light
        (Given(2, 1), "direct", "areas", 1),
        (Given(2, 1), "bounce", "rays", 2),
        (Given(3, 1), "bounce", "areas", 1),
        (Given(1, 1 / 4, shared=(4 / 9, 1 / 4)), "direct", "rays", 1),
        (Given(1.5, 1 / 4, shared=(4 / 9, 1 / 4)), "direct", "areas", 1 / 4),
        (Given(1.5, 1 / 9, shared=(4 / 9, 1 / 4)), "direct", "areas", 1 / 4),
        (Given(1.5, 1 / 3, shared=(4 / 9, 1 / 4)), "direct", "areas", 4 / 9),
        (Given(NEVER, 2, shared=(4 / 9, 1 / 4)), "direct", "areas", 2),
    ],
)
def test_the_cheaper_samples_behind_pupils(trials, light, kind, number):
    found = chosen(trials, BLURRED, light)
    assert (found.kind, found.number, found.enough) == (kind, number, True)


@pytest.mark.parametrize(
    ("before", "kind", "number"),
    [
        ((2.0, 2.0), "rays", 1),  # an area costs more
        ((2.2, 2.0), "rays", 1),
        ((2.201, 2.0), "areas", 1),
        ((2.0, 2.3), "rays", 1),
    ],
)
def test_if_nothing_is_enough_the_cheapest_close_to_the_best_is_chosen(before, kind, number):
    """Errors within a tenth of the smallest one are close to it."""
    found = chosen(Given(NEVER, NEVER, before))
    assert (found.kind, found.number, found.enough) == (kind, number, False)


def test_areas_that_err_as_little_as_the_omitted_light_are_not_compared_with_rays():
    """The omitted light alone exceeds the allowed error. Rays would be cheaper, with errors close to the areas'."""
    trials, allowed = Given(NEVER, NEVER, (0.5, 2.0)), SimpleNamespace(error=0.5, without_light=0.5)
    for left_out, kind in ((2.0, "areas"), (1.999, "rays")):
        assert fewest_samples(trials, PERFECT, Level("light", "bounce", left_out, ""), allowed).kind == kind


def test_receptors_of_different_sizes_need_rays():
    sampling = SimpleNamespace(eye=SimpleNamespace(lattice="lattice"))
    found = chosen(Given(32, 1), sampling)
    assert (found.kind, found.number) == ("rays", 32)


def test_numbers_of_rays_grow_by_about_the_square_root_of_two():
    halves = [
        k / 32 for k in (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024, 1536, 2048)
    ]
    assert list(PUPIL_RAYS) == halves


@pytest.mark.parametrize("shares", [None, Shares(bands=0.5, depth=0.3, light=0.2)])
@pytest.mark.parametrize("has_pupil", [False, True])
def test_stages_are_told_what_they_may_use(shares, has_pupil):
    asked = {}

    class Stages:
        eye = SimpleNamespace(pupil="pupil" if has_pupil else None, bands=3)
        allowed = 0.1

        def bands(self):
            return Level("bands", "3", None, "")

        def depth(self, allowed):
            asked["depth"] = allowed
            return ONE_PSF, None

        def light(self, depth, allowed):
            asked["light"] = depth, allowed
            return Level("light", "bounce", 0.01, "")

        def samples(self, depth, light, allowed):
            asked["samples"] = allowed
            return Samples("rays", light, 7, Level("rays", "7", 0.0, ""), True)

    stages = Stages()
    stages.shares = shares
    found = cheapest(stages)
    assert asked["depth"] == pytest.approx(0.03 if shares else 0.1)
    assert asked["light"] == (ONE_PSF, pytest.approx(0.02 if shares else 0.1))
    left = shares.left(0.1, has_pupil, 0.01) if shares else SimpleNamespace(error=0.1, without_light=0.1)
    assert (asked["samples"].error, asked["samples"].without_light) == (left.error, left.without_light)
    assert (found.rays_per_receptor, found.bands, found.light, found.samples) == (7, 3, "bounce", "rays")
    assert [level.stage for level in found.levels] == ["bands", "light", "rays"]


@pytest.mark.parametrize("shares", [None, Shares(0.5, 0.5, 0.5)])
def test_errors_of_stages_that_share_add_up(shares, recwarn):
    """Alone, neither 0.08 nor 0.07 exceeds the allowed 0.1."""

    class Stages:
        eye = SimpleNamespace(pupil=None, bands=3)
        allowed = 0.1

        def bands(self):
            return Level("bands", "3", 9.0, "")

        def depth(self, allowed):
            return ONE_PSF, Level("depth", "x", 0.08, "")

        def light(self, depth, allowed):
            return Level("light", "direct", 0.0, "")

        def samples(self, depth, light, allowed):
            return Samples("rays", light, 7, Level("rays", "7", 0.07, ""), True)

    stages = Stages()
    stages.shares = shares
    cheapest(stages)
    assert [str(one.message)[:70] for one in recwarn] == (
        ["the best available fidelity has an error of 1.1e-01 of a signal, 1.1 ti"[:70]] if shares else []
    )


def test_the_error_of_samples_includes_omitted_light():
    light, level = Level("light", "direct", 0.3, ""), Level("rays", "1", 0.4, "")
    assert Samples("rays", light, 1, level, True).error == pytest.approx(0.5)
    assert Samples("rays", light, 1, Level("rays", "1", None, ""), True).error == pytest.approx(0.3)
    assert Samples("rays", Level("light", "all", None, ""), 1, level, True).error == pytest.approx(0.4)
