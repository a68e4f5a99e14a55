"""Levels and tables of fidelities from given errors: every limit, default and reason."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import optics
import sim
from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.eyes.receptive_fields import NoRaysError
from sim.render import fidelity_stages, memory_budget, sample_choice
from sim.render.edge_rays import FIRST
from sim.render.fidelity import Fidelity, Level, requested_fidelity
from sim.render.fidelity_stages import CAUTION, depth, light
from sim.render.renderable import check_renderable
from sim.render.sample_choice import _fewest, _left

EYE = sim.Eyes(n_eyes=1, resolution=(5, 5)).eye()
BEHIND_A_PUPIL = sim.Eyes(n_eyes=1, resolution=(5, 5), optics=optics.Pupil(1e-4)).eye()


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ((0, 1), "rays_per_receptor = 0: must be positive and at most 1e"),
        ((1.01e7, 1), "rays_per_receptor = 10100000.0: must be positive and at most 1e"),
        (("4", 1), "rays_per_receptor = '4': must be positive"),
        ((4, 0), "bands = 0"),
        ((4, 4097), "bands = 4097"),
    ],
)
def test_limits_of_numbers(arguments, reason):
    with pytest.raises(ValueError, match=f"^{reason}"):
        Fidelity(*arguments)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"tolerance": math.inf}, "tolerance = inf: must be positive, or None"),
        ({"tolerance": -1e-3}, "tolerance = -0.001: must be positive, or None"),
        ({"tolerance": "x"}, "tolerance = 'x': must be positive, or None"),
        ({"frames": 0}, "frames = 0"),
        ({"frames": 10**6 + 1}, "frames = 1000001"),
        ({"light": "none"}, "light = 'none'"),
        ({"samples": "none"}, "samples = 'none'"),
        ({"light": "all"}, "light = 'all': must be used with samples = 'areas'"),
        ({"light": "all", "samples": "edges"}, "light = 'all': must be used with samples = 'areas'"),
    ],
)
def test_limits_of_options(options, reason):
    with pytest.raises(ValueError, match=f"^{reason}"):
        Fidelity(4, 2, **options)


def test_the_largest_values_and_the_defaults():
    Fidelity(1e7, 4096, frames=10**6, tolerance=1e300, light="all", samples="areas")
    found = Fidelity(4, 2)
    assert (found.depth, found.light, found.samples) == (ONE_PSF, "direct", "rays")
    assert (found.frames, found.tolerance, found.levels) == (None, None, ())
    assert (found.predicted_error, found.why) == (None, "as requested")


def test_tables():
    table = str(Fidelity(2.5, 3, light="bounce", frames=7)).splitlines()
    assert [line.split()[0] for line in table] == ["stage", "bands", "depth", "light", "rays", "frames"]
    assert {len(line[: line.index("as requested")]) for line in table[1:]} == {table[0].index("why")}
    for line, words in zip(table[1:], ("3", str(ONE_PSF), "bounce", "2.5 per receptor", "7 per action"), strict=True):
        assert line.split("  ", 1)[1].strip().startswith(words)
    assert "frames" not in str(Fidelity(2.5, 3))
    levels = (Level("bands", "3", 0.03, "few"), Level("depth", "x", None, "one"), Level("rays", "4", 0.04, "many"))
    chosen = Fidelity(4, 3, levels=levels)
    assert chosen.predicted_error == pytest.approx(0.05)
    assert chosen.why == "bands: few\ndepth: one\nrays: many"
    assert [line.split() for line in str(chosen).splitlines()] == [
        ["stage", "level", "error", "why"],
        ["bands", "3", "3.0e-02", "few"],
        ["depth", "x", "one"],
        ["rays", "4", "4.0e-02", "many"],
    ]


def test_requested_numbers_of_rays():
    eyes = sim.Eyes(n_eyes=1, resolution=(5, 5))
    assert requested_fidelity(8, eyes) == Fidelity(8, eyes.bands)
    assert requested_fidelity("auto", eyes) is None
    with pytest.raises(ValueError, match=r"^rays_per_receptor = 'many': must be positive, or 'auto'"):
        requested_fidelity("many", eyes)


@pytest.mark.parametrize(
    ("eye", "fidelity", "reason"),
    [
        (EYE, Fidelity(FIRST, EYE.bands, samples="edges"), None),
        (EYE, Fidelity(FIRST - 1, EYE.bands, samples="edges"), f"must be at least {FIRST} where samples = 'edges'"),
        (EYE, Fidelity(8, EYE.bands, samples="edges", light="bounce"), "samples = 'edges': is for direct light"),
        (BEHIND_A_PUPIL, Fidelity(8, BEHIND_A_PUPIL.bands, samples="edges"), "'edges': is for perfect lenses"),
        (BEHIND_A_PUPIL, Fidelity(0.5, BEHIND_A_PUPIL.bands), None),
        (EYE, Fidelity(8, EYE.bands + 1), f"bands = {EYE.bands + 1}: must be the scene's {EYE.bands}"),
    ],
)
def test_a_fidelity_fits_its_eye(eye, fidelity, reason):
    if reason is None:
        check_renderable(fidelity, eye)
        return
    with pytest.raises(ValueError, match=reason):
        check_renderable(fidelity, eye)


class Trials:
    """Trials with given errors of layers and given light.

    surfaces: distances of visible surfaces [m]
    """

    def __init__(self, errors=None, reflected=None, surfaces=(1.0, 20.0)):
        self.errors, self.reflected, self.asked = errors, reflected, None
        self.surfaces = np.linspace(*surfaces, 1000)

    def distances(self):
        return self.surfaces

    def errors_of_layers(self, finest, counts):
        self.asked = finest, counts
        if self.errors is None:
            raise optics.AccuracyError("too near")
        return dict(zip(counts, self.errors, strict=True))

    def reflected_twice(self, sampling):
        if self.reflected is None:
            raise ValueError("no closed form")
        return self.reflected


@pytest.mark.parametrize(
    ("errors", "count"),
    [
        ((1, 0.5, 0.2, 0.1), 1),
        ((1.01, 1, 0.2, 0.1), 3),
        ((9, 3, 1, 0.1), 5),
        ((9, 3, 1.01, 1), 9),
        ((9, 8, 7, 6), 9),
    ],
)
def test_the_fewest_layers(errors, count):
    """Errors are multiplied by 1.2, because those in episodes may be larger; the finest have nine layers."""
    allowed = 1e-6
    trials = Trials([error * allowed / 1.2 for error in errors])
    layers, level = depth(trials, BEHIND_A_PUPIL, allowed)
    far, near = 20.0, float(trials.surfaces[5])
    assert trials.asked == (DepthLayers(far, near, 9), (1, 3, 5, 9))
    assert layers == DepthLayers(far, near, count)
    assert (level.stage, level.level) == ("depth", str(layers))
    assert level.predicted_error == pytest.approx(errors[(1, 3, 5, 9).index(count)] * allowed)
    assert level.why == "fewest of 1 ... 9 for 1.0e-06"


def test_one_psf_where_it_is_enough_or_the_only_one():
    assert depth(None, EYE, 0.0) == (ONE_PSF, Level("depth", str(ONE_PSF), 0.0, "a perfect lens does not blur"))
    trials = Trials()
    layers, level = depth(trials, BEHIND_A_PUPIL, 1e-9)
    assert layers == DepthLayers(20.0, float(trials.surfaces[5]), 1)
    assert (level.level, level.predicted_error, level.why) == ("one PSF", None, "at the mean depth: too near")
    layers, level = depth(trials, BEHIND_A_PUPIL, 1e9)
    near, eye = float(trials.surfaces[5]), BEHIND_A_PUPIL
    shift = 4 / (3 * math.pi) * eye.sensor_distance * 1e-4 / near * 2 / eye.receptor_pitch
    assert layers == ONE_PSF
    assert level.predicted_error == pytest.approx(eye.throughput * shift)
    assert level.why == f"blur of {shift:.1e} of a receptor at {near:.2g} m, the nearest visible distance"


def test_light():
    """Further reflections are a geometric series: twice² / (direct - twice), at most `twice` itself."""
    for reflected, allowed, expected in (
        ((0.01, 1.0), 0.01, ("direct", 0.01)),
        ((0.0101, 1.0), 0.01, ("bounce", 0.0101**2 / (1 - 0.0101))),
        ((0.5, 0.6), 0.01, ("bounce", 0.5)),
        ((0.2, 0.4), 0.01, ("bounce", 0.2)),
        (None, 0.01, ("direct", None)),
    ):
        found = light(Trials(reflected=reflected), None, allowed)
        assert (found.stage, found.level, found.predicted_error) == ("light", expected[0], pytest.approx(expected[1]))
    assert found.why == "the error by light that is reflected twice is unknown: no closed form"


def test_the_fewest_bands_in_a_medium():
    """The number grows until the medium's error is allowed as well, up to the finest."""
    clear, level = fidelity_stages.bands(EYE, 0.05)
    assert (level.level, level.predicted_error) == (f"{clear}", 0.05)
    for enough in (clear, clear + 3, 10**6):
        medium = SimpleNamespace(band_error=lambda n, receptors, e=enough: (0.05 if n >= e else 0.06) / EYE.throughput)
        found, level = fidelity_stages.bands(EYE, 0.05, medium)
        assert found == min(enough, fidelity_stages.FINEST)
        assert level.predicted_error == pytest.approx(0.05 if enough < 10**6 else 0.06)
        assert level.why.startswith("fewest for" if enough < 10**6 else "most, not enough for")


@pytest.mark.parametrize(
    ("errors", "chosen", "tried"), [((8, 4, 1, 1), 8, [1, 8]), ((3, 2, 1, 1), 3, [1, 3]), ((1, 1, 1, 1), 1, [1])]
)
def test_numbers_of_samples_that_cannot_be_enough_are_skipped(errors, chosen, tried):
    """Errors fall at most like 1 / n."""
    table, asked = dict(zip((1, 2, 3, 8), errors, strict=True)), []

    def error(number):
        asked.append(number)
        return table[number] / CAUTION

    number, level, enough = _fewest(error, (1, 2, 3, 8), 1.0, "rays")
    assert (number, enough, asked) == (chosen, True, tried)
    assert level.why == f"fewest of 1 ... 8 for 1.0e+00, {len(tried)} tried"
    assert level.predicted_error == pytest.approx(table[number])


def test_if_no_number_of_samples_is_enough_the_fewest_close_to_the_best_is_chosen():
    for errors, best in (((4.4, 4.0), 1), ((4.41, 4.0), 2)):
        found = _fewest(lambda n, e=errors: e[n - 1] / CAUTION, (1, 2), 1.0, "areas")
        assert (found[0], found[2]) == (best, False)
        assert found[1].level == f"{best} per receptor"
        assert found[1].why == "not enough, but close to the best of 1 ... 2 for 1.0e+00, 2 tried"


def test_numbers_without_rays_are_no_error():
    def error(number):
        if number < 4:
            raise NoRaysError("no rays")
        return 0.5

    number, level, enough = _fewest(error, (1, 2, 4, 8), 1.0, "rays")
    assert (number, enough) == (4, True)
    assert level.why.endswith("3 tried")


def test_what_omitted_light_leaves_of_the_allowed_error():
    allowed = SimpleNamespace(without_light=0.5, error=1.0)
    for error, left in ((None, 0.5), (0.0, 0.5), (0.3, 0.4), (0.5, 0.5e-6), (0.9, 0.5e-6)):
        assert _left(Level("light", "direct", error, ""), allowed) == pytest.approx(left)


@pytest.mark.parametrize("shared", [(), (4 / 9, 1 / 4, 1 / 9)])
def test_areas_are_shared_as_far_as_their_error_allows(monkeypatch, shared):
    errors = {1: 0.4, 4 / 9: 0.5, 1 / 4: 1.0, 1 / 9: 1.01}
    trials = SimpleNamespace(
        have_areas=lambda *lights: lights == ("bounce", "all"),
        area_errors=lambda sampling, light: lambda n: errors[n] / CAUTION,
        reflected_more_often=lambda sampling: 0.123,
    )
    allowed = SimpleNamespace(without_light=1.0, error=0.1)
    found = sample_choice._areas(trials, None, Level("light", "bounce", 0.2, ""), shared, allowed)
    assert (found.kind, found.number, found.enough) == ("areas", 1 / 4 if shared else 1, True)
    assert (found.light.level, found.light.predicted_error) == ("all", None)
    assert "adds 1.2e-01" in found.light.why
    if shared:
        assert found.level.level == "0.25 per receptor"
    assert sample_choice._areas(trials, None, Level("light", "direct", 0.2, ""), shared, allowed) is None


def test_free_memory_of_machines(monkeypatch, tmp_path):
    texts = {"/proc/meminfo": "MemTotal:  10 kB\nMemAvailable:   7 kB\n"}

    def read(path, *_, **__):
        if str(path) not in texts:
            raise OSError
        return texts[str(path)]

    monkeypatch.setattr(memory_budget.Path, "read_text", read)
    assert memory_budget._of_machine() == 7 * 1024
    texts.clear()
    monkeypatch.setattr(memory_budget.os, "sysconf", lambda name: {"SC_PHYS_PAGES": 5, "SC_PAGE_SIZE": 4096}[name])
    assert memory_budget._of_machine() == 5 * 4096
    monkeypatch.delattr(memory_budget.os, "sysconf")
    assert memory_budget._of_machine() == math.inf


@pytest.mark.parametrize("value", [1234.0, 10.0, 9.99, 0.0123, 100.0])
def test_rounding_to_two_digits(value):
    found = memory_budget._rounded_down(value)
    assert 0.9 * value < found <= value
    assert float(f"{found:.1e}") == pytest.approx(found)


def test_memory_is_enough_up_to_the_last_byte(monkeypatch):
    demand = memory_budget.Demand(4.0, 3, 2, (5, 7), 6, 8)
    rays = 4 * 35
    assert demand.elements == rays * 2 * 3 * 6
    assert demand.bytes == 4 * demand.elements + rays * (64 * 2 + 16 * 8 * 7)
    monkeypatch.setattr(memory_budget, "available", lambda: demand.bytes)
    memory_budget.check_memory(demand)
    monkeypatch.setattr(memory_budget, "available", lambda: demand.bytes / 2)
    with pytest.raises(ValueError, match=r"rays_per_receptor = 4: 3 worlds with 2 eyes of 5 x 7 .* use at most 2 rays"):
        memory_budget.check_memory(demand)
    monkeypatch.setattr(memory_budget, "available", lambda: math.inf)
    monkeypatch.setattr(memory_budget, "INDICES", demand.elements)
    memory_budget.check_memory(demand)
    monkeypatch.setattr(memory_budget, "INDICES", demand.elements / 4)
    with pytest.raises(ValueError, match="use at most 1 rays"):
        memory_budget.check_memory(demand)
