"""The benchmark against other packages: its oracle, its grids, its goals and its file can each fail with a message."""

from dataclasses import replace
from importlib import metadata

import numpy as np
import pytest

from validation import reference
from validation.peers import MODULES, installed, work_precision
from validation.peers.goals import verdicts
from validation.peers.measure import median_seconds, one_thread, quickest
from validation.peers.points import STORED, Point, read_points, write_points
from validation.peers.problem import CASES, WAVELENGTH, Case, SampleGrid, error, grids

NAMED = {case.name: case for case in CASES}
STAMP = ("2026-11-21", "2 cores")


def point(peer="other", error=1e-4, seconds=1e-2, kind="exact", dtype="complex128", samples=256, case="f/2"):
    return Point(case, peer, "1.0", "a, method", kind, samples, 1e-6, dtype, error, seconds, *STAMP)


# The problem


def test_exact_is_what_is_known_in_closed_form_on_the_axis():
    case = NAMED["near field"]
    on_axis = reference.circular_aperture_on_axis(case.radius, case.distance, WAVELENGTH)
    assert case.exact()[64, 64] == pytest.approx(on_axis, rel=1e-10)
    lens = NAMED["f/16"]
    focus = reference.converging_wave_at_focus(lens.radius, lens.focal_length, WAVELENGTH)
    assert lens.exact()[64, 64] == pytest.approx(abs(focus) ** 2, rel=1e-10)


def test_exact_refuses_to_be_the_airy_pattern():
    """A paraxial result has an error of 5e-4 at f/16, even if its scale is fitted. The oracle detects this error."""
    case = NAMED["f/16"]
    r = np.hypot(case.window.x[None, :], case.window.x[:, None])
    airy = reference.airy_psf(r, WAVELENGTH, case.radius, case.focal_length)
    assert 3e-4 < error(case, airy, fitted=True) < 1e-2


def test_the_scale_is_fitted_for_peers_only():
    case = NAMED["f/16"]
    assert error(case, 3 * case.exact(), fitted=True) < 1e-15
    assert error(case, 3 * case.exact(), fitted=False) == pytest.approx(2)
    assert error(case, np.full((129, 129), np.nan), fitted=True) == np.inf
    assert error(case, case.exact()[1:, 1:], fitted=True) == np.inf


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_grids_hold_pupil_and_window_and_carry_the_lens(case):
    found = grids(case)
    assert len({grid.n for grid in found}) >= 4
    for grid in found:
        assert 128 <= grid.n <= 1080
        assert grid.n % 2 == 0
        assert grid.x[-1] >= max(case.radius, case.half_window)
        if case.has_lens:
            sine = np.sin(np.arctan(case.radius / case.focal_length))
            assert grid.dx < WAVELENGTH / (2 * sine)


def test_interpolation_is_exact_on_samples_and_for_band_limited_fields():
    case = Case("one", 10e-6, 100e-6, 8e-6)
    fine = SampleGrid(258, case.window.dx / 2)
    values = np.random.default_rng(0).normal(size=(258, 258)) + 0j
    assert case.resampled(values, fine) == pytest.approx(np.abs(values[1::2, 1::2]) ** 2, abs=1e-12)
    coarse = SampleGrid(400, 3 * case.window.dx)
    wave = np.exp(-((coarse.x / (5 * coarse.dx)) ** 2))
    expected = np.exp(-((case.window.x / (5 * coarse.dx)) ** 2))
    assert case.resampled(np.outer(wave, wave), coarse) == pytest.approx(np.outer(expected, expected) ** 2, abs=1e-12)


# The file


def test_points_survive_the_file(tmp_path):
    points = [point(), replace(point(case="near field"), detail='padded, "twice"', error=1.234e-7)]
    write_points(points, tmp_path / "some.csv")
    assert read_points(tmp_path / "some.csv") == points
    assert [path.name for path in tmp_path.iterdir()] == ["some.csv"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("case,", "", "first line"),
        ("256", "many", "line 2"),
        ("1e-06,complex", "complex", "line 2"),
        (",1.0,", ",", "line 2"),
    ],
)
def test_a_spoilt_file_is_named_with_its_line(tmp_path, old, new, said):
    path = tmp_path / "some.csv"
    write_points([point()], path)
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(ValueError, match=said):
        read_points(path)


def test_stored_points_are_of_known_cases_and_peers_that_came_close():
    """An error above 10 % with the best settings of a package would indicate that we use it incorrectly."""
    points = read_points()
    assert {p.case for p in points} == set(NAMED)
    for case in NAMED:
        for peer in {p.peer for p in points}:
            mine = [p for p in points if (p.case, p.peer) == (case, peer)]
            assert mine
            assert min(p.error for p in mine) < 0.1, (case, peer)
    assert all(p.date and p.machine and p.version for p in points)


# The goals

PEERS = [
    point("slow", 1e-5, 1.0),
    point("slow", 9e-4, 2e-2, samples=128),
    point("quick", 1e-4, 1e-1),
    point("paraxial", 3e-2, 1e-4, kind="paraxial"),
    point("spectral", 1e-3, 5e-3, kind="angular spectrum"),
]
OURS = [
    replace(point("rhabdom", 1e-7, 4e-4), dtype="float64"),
    replace(point("rhabdom", 5e-6, 3e-4), dtype="float32"),
    replace(point("rhabdom", 1.5e-3, 4e-3, kind="angular spectrum"), dtype="float32"),
]


def passed(ours, peers=PEERS):
    return {verdict.goal: verdict.passed for verdict in verdicts(ours, peers)}


def test_goals_hold_on_points_that_meet_them():
    assert passed(OURS) == {1: True, 2: True, 3: True}


@pytest.mark.parametrize(
    ("index", "change", "goal"),
    [
        (0, {"seconds": 6e-4}, 1),  # "spectral", the quickest at its own best, takes 5 ms: less than ten times as long
        (0, {"error": 2.1e-7}, 1),
        (1, {"seconds": 6e-3}, 2),  # later than "spectral", which reaches 1e-3 in 5 ms
        (1, {"error": 1.1e-5}, 2),
        (1, {"dtype": "float64"}, 2),
        (2, {"error": 2.1e-3}, 3),
        (2, {"seconds": 5.1e-3}, 3),
    ],
)
def test_each_goal_is_missed_alone(index, change, goal):
    ours = list(OURS)
    ours[index] = replace(ours[index], **change)
    assert [g for g, holds in passed(ours).items() if not holds] == [goal]


def test_a_paraxial_peer_at_its_best_is_no_rival_for_exactness_but_is_for_speed():
    assert passed(OURS, [*PEERS, point("paraxial", 2e-2, 1e-6, kind="paraxial")])[1]
    assert not passed(OURS, [*PEERS, point("paraxial", 9e-4, 2e-4, kind="paraxial")])[2]


def test_spectra_are_timed_against_the_quickest_that_is_as_near():
    assert not passed(OURS, [*PEERS, point("nearly", 1.9e-3, 1e-3, kind="angular spectrum")])[3]
    assert passed(OURS, [*PEERS, point("coarse", 2.1e-3, 1e-3, kind="angular spectrum")])[3]
    assert passed(OURS, [*PEERS, point("finer", 1e-5, 1e-3, kind="angular spectrum", samples=512)])[3]


def test_nothing_to_compare_with_is_no_pass():
    assert not passed(OURS, [])[1]


def test_the_sentence_names_both_sides():
    sentence = str(verdicts(OURS, PEERS)[0])
    assert "1.0e-07 in 0.4 ms; 12.5x" in sentence
    assert "spectral" in sentence
    assert "slow" in sentence  # the most accurate


# The measurement


def test_the_least_median_of_all_rounds_is_kept():
    rounds = [[point(seconds=2e-2), point(samples=512)], [point(seconds=1e-2), point(samples=512, seconds=3e-2)]]
    assert [(p.samples, p.seconds) for p in quickest(rounds)] == [(256, 1e-2), (512, 1e-2)]


def test_the_median_is_of_at_least_so_many_calls_after_warming_up():
    calls = []
    seconds = median_seconds(lambda: calls.append(0), repeats=7, least=0.0)
    assert len(calls) == 1 + 7
    assert 0 < seconds < 1


def test_one_thread_gives_back_what_it_took():
    import drjit as dr
    import torch

    before = dr.thread_count(), torch.get_num_threads()
    with one_thread():
        assert (dr.thread_count(), torch.get_num_threads()) == (1, 1)
    assert (dr.thread_count(), torch.get_num_threads()) == before


def test_every_peer_has_an_adapter_and_only_installed_ones_run():
    for peer in installed():
        assert metadata.version(peer.distribution) == installed()[peer]
    assert len(MODULES) == 10


# The whole benchmark


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr("validation.peers.rhabdom.TOLERANCES", (1e-3, 1e-6))
    monkeypatch.setattr("validation.peers.rhabdom.EXACT", {"rayleigh_sommerfeld": None})
    monkeypatch.setattr("validation.peers.measure.grids", lambda case: grids(case)[:1])


def test_end_to_end_over_stored_points(few, tmp_path, capsys):
    path = tmp_path / "stored.csv"
    write_points([replace(p, case="f/16") for p in PEERS], path)
    code = work_precision.main(["--cases", "f/16", "--stored", str(path), "--out", str(tmp_path)])
    said = capsys.readouterr().out
    assert "stored (2026-11-21 on 2 cores)" in said
    assert "indicative only" in said
    assert said.count("goal ") == 2  # no stored angular spectrum has our number of samples
    assert code == (1 if "FAIL" in said else 0)
    assert (tmp_path / "work_precision.png").stat().st_size > 10_000


def test_our_points_are_within_what_was_asked(few):
    from validation.peers.measure import our_points

    points = list(our_points(NAMED["f/16"], "here"))
    psfs = [p for p in points if p.kind == "exact"]
    assert {p.method for p in psfs} == {"auto", "rayleigh_sommerfeld"}
    for p in psfs:
        assert p.error <= float(p.detail.split(",")[0].removeprefix("tolerance "))
    assert {p.dtype for p in points if p.kind == "angular spectrum"} == {"float32", "float64"}


def test_write_without_peers_is_refused(capsys):
    with pytest.raises(SystemExit):
        work_precision.main(["--write"])
    assert "give both" in capsys.readouterr().err


def test_stored_file_is_part_of_the_checkout():
    assert STORED.name == "measured.csv"
    assert STORED.exists()
