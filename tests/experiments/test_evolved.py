"""Runs become rows; rows become means with intervals, power laws and pages."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import safetensors.numpy

from evolve.config.assemble import assemble
from evolve.config.numbering import Place
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.learning.policy import PolicyConfig, build_policy, save_policy
from evolve.report.eye_figures import relief_heights
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation
from evolve.store.versions import machine
from experiments import bending_light, brains_and_acuity, goals_shape_eyes, learning_through_holes
from experiments.candidates import Row, full_return, parameters, rows_of
from experiments.evolved import RunMetadata, Store, main
from experiments.glass import relief_of
from experiments.means import last_mean
from experiments.store import Origin, write_rows
from optics import Pupil
from optics.numerics import backend


@pytest.fixture(autouse=True)
def few_searches(monkeypatch):
    monkeypatch.setattr("experiments.drift.SEEDS", 10)


SMALL = ("search.population=2", "search.generations=2")
PHASES = (*SMALL, "genome.doe.opens_at=1", "genome.refractive_index.opens_at=1")


def run_of(path, preset, settings, fitness):
    """A run whose candidates were never trained; fitness None marks a failed candidate."""
    config = assemble(preset=preset, assignments=settings)
    run = Run.create(path, config)
    start = Genotype(config.genome).start
    for identity, value in enumerate(fitness):
        outcome = Evaluation.failed("too weak") if value is None else Evaluation(value, (value,) * 4, 0.25, 10, 1.0)
        genome = np.clip(start + 0.01 * identity, 0, 1)
        run.append(
            Candidate.from_evaluation(
                Place.from_id(identity, 2), tuple(genome), develop(genome, config), identity, outcome
            )
        )
    return run


ROW = Row(*("a", 0, 0, 0, 0, 0, 1.0, 0.5, 4, 2, 60.0, 45.0, 8, 8, 0.1, 5, 64, 1000))


def test_candidates_become_rows(tmp_path):
    rows = rows_of(run_of(tmp_path / "run", "bifurcation-detection", SMALL, (1.0, None, 3.0, 2.0)), "detection")
    assert [(r.generation, r.index, r.failed, r.fitness) for r in rows] == [
        *((0, 0, 0, 1.0), (0, 1, 1, -math.inf), (1, 0, 0, 3.0), (1, 1, 0, 2.0))
    ]
    first = rows[0]
    assert (first.n_eyes, first.height, first.width, first.episodes) == (1, 1, 1, 4)
    assert first.cpd == pytest.approx(1 / 90)
    assert math.isnan(first.relative_aperture)


def test_parameters_are_those_of_a_stored_policy(tmp_path):
    shape = PolicyConfig((3, 2, 3, 4, 5), neurons=16, layers=3)
    save_policy(build_policy(shape), tmp_path / "policy.safetensors")
    stored = safetensors.numpy.load_file(tmp_path / "policy.safetensors")
    assert parameters(shape) == sum(tensor.size for tensor in stored.values())


def test_candidates_with_more_receptors_have_more_parameters(tmp_path):
    wider = (*SMALL, "genome.resolution.start=9")
    small, large = (
        rows_of(run_of(tmp_path / name, "bifurcation-detection", settings, (1.0, 1.0)), "detection")[0].parameters
        for name, settings in (("small", SMALL), ("large", wider))
    )
    assert 0 < small < large


@pytest.mark.slow
def test_the_best_of_each_generation_is_looked_through(tmp_path):
    backend.require()
    small = ("genome.resolution_height.start=4", "genome.resolution_width.start=4", "genome.n_eyes.start=1")
    rows = rows_of(run_of(tmp_path / "run", "lens", (*PHASES, *small), (1.0, 4.0, None, 2.0)), "lens")
    assert [math.isfinite(row.strehl) for row in rows] == [False, True, False, True]
    assert [row.phase for row in rows] == [0, 0, 1, 1]
    best = rows[1]
    assert 0 < best.image_quality < best.above_noise < 1
    assert best.above_noise == pytest.approx(best.above_noise_of_hole, rel=0.05), "the relief is nearly flat"
    assert len(best.relief.split()) == 16


def test_mean_is_over_the_last_generations_that_succeeded():
    rows = [replace(ROW, generation=g, fitness=float(g), failed=int(g == 9)) for g in range(10)]
    assert last_mean(rows, lambda row: row.fitness).mean == 7.5
    assert last_mean(rows, lambda row: math.nan) is None


def test_seeds_that_differ_make_the_interval_wide():
    """Two seeds with different means and no spread within each: Student's factor for one degree of freedom is 12.7, and
    candidates are not counted as independent."""
    rows = [replace(ROW, seed=seed, index=i, fitness=1.0 + 2 * seed) for seed in (0, 1) for i in range(50)]
    found = last_mean(rows, lambda row: row.fitness)
    assert found.mean == 2.0
    assert (found.low, found.high) == pytest.approx((2 - 12.706, 2 + 12.706), abs=1e-3)
    alone = last_mean(rows[:50], lambda row: row.fitness)
    assert (alone.mean, str(alone)) == (1.0, "1"), "one seed has no interval"


def with_error(wanted, size):
    """A row with this error and size."""
    episodes = 10_000
    failures = wanted * (episodes + 1) - 0.5
    changes = {"episodes": episodes, "success_rate": 1 - failures / episodes, "memory_frames": 1, "cpd": 1.0}
    return replace(ROW, group="navigation", parameters=size, **changes)


def test_exponents_are_of_errors():
    sizes = (1000, 5000, 20_000, 100_000)
    for wanted, shown in (([0.3 * (size / 1e4) ** -0.4 for size in sizes], "0.4 [0.4, 0.4] | 0.69 | 1.00"),
                          ([0.9] * 4, "- | 0.69 | -")):  # fmt: skip
        rows = [with_error(*pair) for pair in zip(wanted, sizes, strict=True)]
        store = Store(rows, [], [], Origin.here(1.0), "")
        assert f"| navigation | 4 | {shown} |" in brains_and_acuity.exponents(store)
        assert "| navigation | - | - | - | - |" in brains_and_acuity.factors(store), "memory and acuity do not vary"


def test_each_factor_has_its_exponent():
    chance = np.random.default_rng(0)
    rows = []
    for cpd, count, frames in zip(*np.exp(chance.uniform(0, 3, (3, 40))), strict=True):
        wanted = 0.5 * cpd**-0.5 * count**-0.1
        rows.append(replace(with_error(wanted, count), cpd=cpd, memory_frames=frames))
    line = brains_and_acuity.factors(Store(rows, [], [], Origin.here(1.0), "")).splitlines()[-1].split("|")
    found = [float(cell.split()[0]) for cell in line[2:5]]
    assert found == pytest.approx([0.5, 0.1, 0.0], abs=1e-3), "exponents of acuity, parameters and memory"


def test_in_a_maze_what_is_missing_of_a_full_return_is_the_error():
    """The full return is 1.5 per metre of the straight paths of 63 to 67 m, plus 10 for the goal."""
    full = full_return("maze")
    assert 1.5 * 63 + 10 < full < 1.5 * 67 + 10
    assert math.isnan(full_return("detection"))
    row = replace(ROW, full_return=full, fitness=0.25 * full, success_rate=0.0)
    assert brains_and_acuity.error(row) == pytest.approx(0.75)


def test_unfinished_generations_do_not_count(tmp_path):
    rows = rows_of(run_of(tmp_path / "run", "bifurcation-detection", SMALL, (1.0, 2.0, 30.0)), "detection")
    assert [row.generation for row in rows] == [0, 0]
    stages = (*SMALL, "search.rungs=2")
    rows = rows_of(run_of(tmp_path / "stages", "bifurcation-detection", stages, (1.0, 2.0)), "detection")
    assert not rows, "candidates trained for half the steps do not count"
    steady = (*SMALL, "search.steady_state=true")
    rows = rows_of(run_of(tmp_path / "steady", "bifurcation-detection", steady, (1.0, 2.0, 30.0)), "detection")
    assert len(rows) == 3, "a steady-state search has no generations"


def test_runs_of_one_group_differ_in_their_seeds_alone(tmp_path, capsys):
    for name, settings in (("a", ()), ("b", ("seed=1", "workers=2")), ("c", ("eye.noise_sigma=0.02",))):
        run_of(tmp_path / name, "bifurcation-detection", (*SMALL, *settings), (1.0, 2.0))
    started = tmp_path / "b" / "versions.json"
    started.write_text(started.read_text().replace(json.dumps(machine()), '"another machine"'))
    collect = ["--docs", str(tmp_path / "docs"), "--runs", f"detection={tmp_path / 'a'}"]
    assert goals_shape_eyes.main([*collect, f"detection={tmp_path / 'b'}"]) == 0
    text = (tmp_path / "docs/goals_shape_eyes.md").read_text()
    assert "| detection, seed 1 | 2 | 1 of 2 | 0.0 |" in text
    assert f"worker seconds on {machine()}; another machine; rhabdom at" in text
    assert goals_shape_eyes.main([*collect, f"detection={tmp_path / 'c'}"]) == 2
    assert "has other settings than the last run of group 'detection'" in capsys.readouterr().err


@pytest.mark.slow
def test_an_answer_does_not_outlive_its_numbers(tmp_path):
    run_of(tmp_path / "a", "bifurcation-detection", SMALL, (1.0, 2.0))
    run_of(tmp_path / "b", "bifurcation-detection", SMALL, (1.0, 3.0))
    page = ["--docs", str(tmp_path / "docs")]
    assert goals_shape_eyes.main([*page, "--runs", f"detection={tmp_path / 'a'}", "--answer", "Yes."]) == 0
    assert goals_shape_eyes.main([*page, "--runs", f"detection={tmp_path / 'a'}"]) == 0
    assert "**Answer.** Yes." in (tmp_path / "docs/goals_shape_eyes.md").read_text()
    assert goals_shape_eyes.main([*page, "--runs", f"detection={tmp_path / 'b'}"]) == 0
    assert "**Answer.** Not judged yet." in (tmp_path / "docs/goals_shape_eyes.md").read_text()


def test_variants_are_compared_at_the_same_generations(tmp_path):
    """A control without a second phase is compared over both phases of the other group."""
    rows = [
        replace(ROW, group=group, generation=g, phase=int(group == "lens" and g >= 4), relative_aperture=1 - 0.1 * g)
        for group in ("lens", "index1") for g in range(8)
    ]  # fmt: skip
    store = Store(rows, [], [], Origin.here(1.0), "")
    for phase, mean in ((0, 0.8), (1, 0.4)):
        line = next(x for x in bending_light.table(store, phase).splitlines() if x.startswith("| relative aperture"))
        assert [float(cell.split()[0]) for cell in line.split("|")[2:6:2]] == pytest.approx([mean, mean])


def test_messages_of_figures_count_pupils_and_lenses():
    def search(group, seed, widths, power, index):
        return [
            replace(ROW, group=group, seed=seed, generation=g, phase=int(g > 3), relative_aperture=a,
                    refractive_index=index, glass_power=power * (g > 3))
            for g, a in enumerate(widths)
        ]  # fmt: skip

    closes_and_opens, stays, opens_at_once = (
        (0.8, 0.3, 0.3, 0.3, 0.5, 0.5, 0.5),
        (0.8, 0.3, 0.3, 0.3, 0.2, 0.2, 0.2),
        (0.8, 0.9, 0.9, 0.9, 0.8, 0.8, 0.8),
    )
    rows = [
        *(search("lens", 0, closes_and_opens, 1, 1.5) + search("lens", 1, stays, -1, 1.5)),
        *(search("lens", 2, opens_at_once, 1, 1.2) + search("index1", 0, stays, 0, 1.0)),
    ]
    store = Store(rows, [], [], Origin.here(1.0), "")
    assert bending_light.message(store) == (
        "In phase I, 3 of 4 pupils close; in phase II, 1 of 3 reopen if a lens is possible, and 0 of 1 if not"
    )
    assert bending_light.message_of_reliefs(store) == (
        "If a lens is possible, glass converges light in 6 of the last 9 animals"
    )


def test_no_error_still_has_a_logarithm():
    assert brains_and_acuity.error(replace(ROW, success_rate=1.0, episodes=4)) == pytest.approx(0.1)


def test_fittest_and_least_fit_are_of_the_last_phase():
    rows = [replace(ROW, generation=g, phase=int(g > 0), fitness=-float(g), relief="0.5") for g in range(4)]
    best, worst = bending_light.extremes(rows)
    assert (best.generation, worst.generation) == (1, 3)
    assert bending_light.extremes([replace(row, failed=1) for row in rows]) == ()


@pytest.mark.parametrize("side", [4, 7])
def test_reliefs_of_any_number_of_genes_are_drawn(tmp_path, side):
    """Heights that rise with the row number rise everywhere and are symmetric, for either kind of interpolation."""
    rows = np.repeat(np.arange(side) / (side - 1), side)
    heights, _ = relief_heights(Pupil(1.0, relief_of(rows)))
    assert (np.diff(heights, axis=0) > 0).all()
    assert heights.mean() == pytest.approx(0.5)
    failed = [replace(ROW, failed=1, relief="0.5 " * 16, seed=1)]
    conduct = [RunMetadata("a", 0, 1, 1, 1, 1.0, "", 0.01, 1e-4)]
    store = Store(
        [replace(ROW, relief=" ".join(map(str, rows)), refractive_index=1.5), *failed],
        conduct,
        [],
        Origin.here(1.0),
        "",
    )
    bending_light.draw_reliefs(store, tmp_path / "reliefs.png")


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("experiment", [goals_shape_eyes, bending_light, brains_and_acuity, learning_through_holes])
def test_pages_come_from_their_stores(experiment, tmp_path, capsys):
    chance = np.random.default_rng(0)
    rows = [
        replace(
            *(ROW,), group=group, seed=seed, generation=g, phase=int(g > 1), index=i, fitness=chance.random(),
            cpd=chance.random(), parameters=int(chance.integers(100, 10_000)), relative_aperture=chance.random(),
            refractive_index=1.5, strehl=0.1, relief=" ".join(f"{u:.2f}" for u in chance.random(16)),
        )
        for group in ("navigation", "detection") for seed in (3, 4) for g in range(4) for i in range(3)
    ]  # fmt: skip
    stem = tmp_path / "data" / experiment.NAME
    write_rows(rows, stem.with_suffix(".csv"))
    groups = [(group, seed) for group in ("navigation", "detection") for seed in (3, 4)]
    runs = [RunMetadata(*run, 12, 4, 4, 1.0, "abc", 0.01, 1e-4) for run in groups]
    write_rows(runs, stem.with_name(f"{stem.name}_runs.csv"))
    Origin.here(1.0).write(stem.with_suffix(".json"))
    assert experiment.main(["--docs", str(tmp_path), "--answer", "Partly, because nobody learnt."]) == 0
    assert experiment.main(["--docs", str(tmp_path)]) == 0, "the stored answer is reused"
    text = (tmp_path / f"{experiment.NAME}.md").read_text()
    assert "**Answer.** Partly, because nobody learnt." in text
    for line in text.splitlines():
        if line.startswith("!["):
            assert (tmp_path / line.rpartition("(")[2][:-1]).stat().st_size > 5000
    if experiment is goals_shape_eyes:
        assert "| navigation, seed 3 |" in text
        assert "| detection, seed 4 |" in text


def test_what_cannot_be_collected_gets_one_line(tmp_path, capsys):
    def page(store):
        raise AssertionError("there is nothing to make it of")

    assert main("x", "X", page, ["--docs", str(tmp_path)]) == 2
    assert "holds no runs" in capsys.readouterr().err
    assert main("x", "X", page, ["--docs", str(tmp_path), "--runs", "lens"]) == 2
    assert "--runs: must be GROUP=DIR" in capsys.readouterr().err
    assert main("x", "X", page, ["--docs", str(tmp_path), "--runs", "lens=/absent"]) == 2
    assert "/absent is not a run" in capsys.readouterr().err
