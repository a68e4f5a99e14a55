"""The same animals in both tasks: finished training runs are stored, and the interaction agrees with closed forms."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from evolve.learning.final_figures import final_episodes
from evolve.learning.fitness import evaluate
from evolve.learning.policy import load_policy
from evolve.search.worker import evaluated
from evolve.store.evaluation import Evaluation
from experiments import crossing as crossing_module
from experiments import designed
from experiments.crossing import _interaction, crossing
from experiments.designed import Design, Trained, crossed, train_all
from experiments.eye_shapes import BRIGHT, CONTROLS, DIM, SEEDS, SHAPES, TASKS, designs, with_rows, with_squares
from experiments.eyes_for_tasks import controls_table, crossings_table, page
from experiments.eyes_for_tasks_figure import height_message, light_message
from experiments.store import Origin, read_rows

TINY = (
    *("learning.total_steps=64", "learning.n_envs=4", "learning.n_steps=16", "learning.batch_size=32"),
    *("learning.n_epochs=1", "learning.eval_interval=64", "evaluation.episodes=2", "eye.rays_per_receptor=1"),
)
ANIMAL = Design("navigation", 2, 3, 3, 45.0, 0.01, 0)


def lived(design, fitness):
    return Trained(**vars(design), fitness=fitness, success_rate=0.5, episodes=32, steps=1000, seconds=1.0)


def rows(effect, spread=1.0, noises=(BRIGHT,), seed=0):
    """Training runs in which cameras have `effect` more fitness in detection, and `effect` less in navigation."""
    chance, found = np.random.default_rng(seed), []
    for design in with_rows(designs()):
        if design.noise_sigma in noises:
            camera = design.width == 15
            sign = 1 if design.task == "detection" else -1
            found.append(lived(design, 50 + sign * effect * camera + spread * chance.normal()))
    return found


def test_every_animal_lives_in_both_tasks_and_in_every_light():
    asked = designs()
    assert len(set(asked)) == len(asked)
    bright = [design for design in with_rows(asked) if design.noise_sigma == BRIGHT]
    assert len(bright) == len(SHAPES) * len(TASKS) * len(SEEDS)
    assert {design.height for design in with_rows(asked) if design.task == "navigation"} == {1}
    assert all(design.height == design.width for design in asked if design.task == "detection")


def test_controls_hold_the_height_and_are_not_mixed_with_rows():
    """The controls are square eyes of every shape, equally often in both tasks; a row of the same width is not a
    control."""
    square = with_squares(designs())
    counts = [[sum(d.task == t and (d.n_eyes, d.width) == s[:2] for d in square) for s in SHAPES] for t in TASKS]
    assert counts[0] == counts[1], "navigation and detection have the same controls"
    assert len(designs()) == len(with_rows(designs())) + len(CONTROLS) * len(SEEDS)


def test_a_difference_of_rows_alone_is_not_one_of_squares():
    """Eyes with a single row of receptors fail in navigation and square eyes succeed: the confounded comparison finds
    a difference, and the primary one does not."""
    chance = np.random.default_rng(0)
    every = [lived(d, (20 if d.height == 1 and d.width == 15 else 120) + chance.normal()) for d in designs()]
    confounded = crossing([row for row in with_rows(every) if row.noise_sigma == BRIGHT], np.random.default_rng(0))
    primary = crossing(with_squares(every), np.random.default_rng(0))
    assert confounded.differences["navigation"].high < -90
    assert abs(primary.differences["navigation"].mean) < 2
    assert "low, but not" in height_message(every)
    worse = [replace(row, fitness=row.fitness - 100 * (row.height == row.width == 15)) for row in every]
    assert "at any height" in height_message(worse)
    lines = {line.split(" | ")[0]: line.split(" | ")[1:] for line in controls_table(every).splitlines()}
    square, row = lines["| 2 of 15 x 15 over 45°"], lines["| 2 of 1 x 15 over 45°"]
    assert (square[:3], row[:3]) == (["45", "3", "6"], ["3", "3", "6"])
    assert float(square[3].split()[0]) == pytest.approx(120, abs=2), "five standard errors of six runs"
    assert float(row[3].split()[0]) == pytest.approx(20, abs=2)


def test_an_animal_is_what_its_design_says():
    animal = replace(ANIMAL, neurons=8, memory_frames=2).animal
    assert (animal.n_eyes, animal.resolution, animal.neurons, animal.memory_frames) == (2, (3, 3), 8, 2)
    config = replace(ANIMAL, noise_sigma=0.07).config(TINY)
    assert (config.task, config.eye.noise_sigma, config.learning.total_steps) == ("navigation", 0.07, 64)


def test_an_interaction_is_found_and_measured():
    """Differences of 2 and -2 among training runs with a standard deviation of 0.3 give an interaction of 13 standard
    deviations, within the accuracy that 16 degrees of freedom allow for a standard deviation."""
    found = crossing(rows(2.0, spread=0.3), np.random.default_rng(0))
    assert found.differences["detection"].low < 2 < found.differences["detection"].high
    assert found.differences["navigation"].low < -2 < found.differences["navigation"].high
    assert found.interaction.low < 4 / 0.3 < found.interaction.high
    assert found.interaction.low > 2 * 2.06, "larger than a unit that contains the difference itself would allow"
    assert found.p < 1e-3


@pytest.mark.parametrize(("lives", "held"), [(6, 0.93), (3, 0.88)])
def test_intervals_of_the_interaction_hold_it_as_often_as_the_page_says(lives, held):
    """The coverage in 2000 simulated experiments agrees with the page, up to rounding and three standard errors of a
    binomial. Cameras have twice the number of training runs."""
    chance, found = np.random.default_rng(0), []
    for _ in range(2000):
        fitness = {
            t: (chance.normal(size=lives), chance.normal(s, size=2 * lives))
            for t, s in (("detection", 6), ("navigation", -6))
        }
        one = _interaction(fitness)
        found.append(one.low < 12 < one.high)
    assert abs(np.mean(found) - held) < 0.01 + 3 * np.sqrt(held * (1 - held) / 2000)


def test_no_interaction_where_eyes_matter_alike():
    """One kind of eye is better in both tasks: a main effect is not an interaction."""
    alike = [
        replace(row, fitness=row.fitness + 4 * (row.width == 15) * (row.task == "navigation")) for row in rows(2.0)
    ]
    found = crossing(alike, np.random.default_rng(0))
    assert found.differences["navigation"].low > 0
    assert found.interaction.low < 0 < found.interaction.high
    assert found.p > 0.05


def test_p_is_uniform_where_nothing_matters():
    """A tenth of 200 experiments without any effect have p < 0.1 (within three standard errors of a binomial)."""
    from unittest import mock

    with mock.patch.object(crossing_module, "RESAMPLES", 200):
        found = [crossing(rows(0.0, seed=seed), np.random.default_rng(seed)).p for seed in range(200)]
    assert abs(np.mean(np.array(found) < 0.1) - 0.1) < 3 * np.sqrt(0.1 * 0.9 / 200)


ASKED = crossed([ANIMAL, replace(ANIMAL, n_eyes=1)], ("navigation",), (0.01,), (0,))


class InThisProcess:
    """An executor without a process of its own, which would load all libraries again."""

    def __init__(self, evaluate, *_):
        self._evaluate = evaluate

    def __enter__(self):
        return self

    def __exit__(self, *_):
        """Do nothing."""

    def run(self, jobs):
        for job in jobs:
            yield job, evaluated(self._evaluate, job.arguments, lambda *steps: None)


@pytest.fixture
def in_this_process(monkeypatch):
    """Train in this process; the fixture `stored` trains in a worker."""
    monkeypatch.setattr(designed, "LocalExecutor", InThisProcess)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """Train the first of the requested animals; return its rows and the file that stores them."""
    path = tmp_path_factory.mktemp("trained") / "lives.csv"
    return train_all(ASKED[:1], TINY, path, workers=1), path


@pytest.fixture
def trained(stored, tmp_path):
    """Return the rows of the first animal, and a copy of the file."""
    rows, path = stored
    shutil.copytree(path.parent, tmp_path, dirs_exist_ok=True)
    return rows, tmp_path / path.name


@pytest.mark.slow
def test_what_has_been_trained_is_not_trained_again(trained, capsys, in_this_process):
    first, path = trained
    assert first == read_rows(Trained, path)
    assert not first[0].failed
    assert first[0].steps == 64
    assert first[0].episodes == 2
    capsys.readouterr()
    both = train_all(ASKED, TINY, path, workers=1)
    assert both[0] == first[0]
    assert capsys.readouterr().out.count("of 2") == 1, "only the second design is trained"
    assert Origin.read(path.with_suffix(".json")).whose == "worker"


@pytest.mark.slow
def test_trained_animals_are_tested_in_layouts_that_no_selection_has_used(tmp_path, in_this_process):
    """The row repeats what the test set gives when the same policy is trained here, in this process."""
    family = ("world.layouts=family", *(f"world.{name}_layouts=2" for name in ("training", "selection", "test")))
    given = (*TINY, *family, "world.layout_rows=9", "world.layout_columns=17")
    design = replace(ANIMAL, task="maze")
    (row,) = train_all([design], given, tmp_path / "lives.csv", workers=1, tested=True)
    assert read_rows(Trained, tmp_path / "lives.csv") == [row]
    config, path = design.config(given), tmp_path / "0.safetensors"
    outcome = evaluate(design.animal, config, design.seed, path)
    final = final_episodes(design.animal, config, load_policy(path), design.seed)
    assert row.fitness == pytest.approx(outcome.fitness, rel=1e-5)
    assert (row.held_out, row.held_out_episodes) == (pytest.approx(final.returns.mean(), rel=1e-5), 2)
    assert row.held_out != row.fitness


@pytest.mark.slow
@pytest.mark.parametrize(("kept", "earlier"), [(True, ("a" * 40,)), (False, ())])
def test_rows_that_are_kept_keep_the_version_that_made_them(trained, in_this_process, kept, earlier):
    path = trained[1]
    made = path.with_suffix(".json")
    former = Origin.read(made)
    replace(former, versions={**former.versions, "commit": "a" * 40}).write(made)
    if not kept:
        path.unlink()
    train_all(ASKED if kept else ASKED[:1], TINY, path, workers=1)
    assert Origin.read(made).earlier == earlier


def test_only_needed_animals_are_trained_and_results_may_request_more(tmp_path, in_this_process, monkeypatch):
    """The first call requests the second design. Its result requests the first one. The file keeps the designs' order,
    and a row that is no longer requested stays.
    """
    monkeypatch.setattr(designed, "evaluate_candidate", lambda *_, **__: Evaluation(1.0, (1.0,)))
    seen = []

    def needed(rows):
        seen.append([row.design for row in rows])
        return [ASKED[1:], ASKED[:1], []][len(rows)]

    experiment = designed.Experiment("few", "", lambda: ASKED, TINY, lambda *_: None, needed=needed)
    designed._train(experiment, tmp_path / "few.csv", 1)
    assert seen == [[], ASKED[1:], ASKED]
    assert [row.design for row in read_rows(Trained, tmp_path / "few.csv")] == ASKED


def test_the_page_is_made_from_the_stored_rows(tmp_path):
    every = rows(2.0, noises=(BRIGHT, *DIM))
    made = page(every, Origin.here(1.0, "worker"), "Yes.")
    assert "Yes." in made.markdown
    assert "| 10 of 4 over 135° |" in made.markdown
    made.publish(tmp_path)
    assert (tmp_path / "figures/eyes_for_tasks.png").stat().st_size > 10_000


def test_rows_survive_the_file(tmp_path):
    from experiments.store import write_rows

    some = rows(1.0)[:4]
    write_rows(some, tmp_path / "rows.csv")
    back = read_rows(Trained, tmp_path / "rows.csv")
    assert [row.design for row in back] == [row.design for row in some]
    assert [row.fitness for row in back] == pytest.approx([row.fitness for row in some], rel=1e-5)


def test_lives_that_failed_count_for_nothing():
    """A training run that diverged has no fitness: p is computed from the others."""
    found = rows(0.0, spread=1.0)
    one = next(i for i, row in enumerate(found) if (row.task, row.n_eyes, row.width) == ("detection", 2, 15))
    without = crossing([*found[:one], *found[one + 1 :]], np.random.default_rng(0))
    found[one] = replace(found[one], failed=1, fitness=-np.inf)
    assert crossing(found, np.random.default_rng(0)) == without
    assert without.p > 0.01


def test_without_two_lives_of_each_there_is_no_crossing():
    few = [row for row in rows(2.0, spread=0.3) if row.seed == 0 or row.width != 15]
    few = [row for row in few if not (row.width == 15 and row.task == "detection")]
    with pytest.raises(ValueError, match="needs at least 2 training runs of each kind of eyes in each task"):
        crossing(few, np.random.default_rng(0))
    assert "| σ = 0.01, navigators with rows | - | - | - | - |" in crossings_table(few)


@pytest.mark.parametrize(("effect", "message"), [(1.5, "does not reverse"), (-1.5, "light reverses the order")])
def test_the_figure_says_whether_less_light_turns_the_answer(effect, message):
    found = rows(2.0, spread=0.3) + rows(effect, spread=0.3, noises=(0.05,), seed=1)
    lights = {
        sigma: crossing([row for row in found if row.noise_sigma == sigma], np.random.default_rng(0))
        for sigma in (BRIGHT, 0.05)
    }
    assert message in light_message(lights)


def test_numbers_that_a_stored_run_would_not_match_are_refused():
    with pytest.raises(ValueError, match=r"fov_deg = 33\.3333333: must be a stored number, such as 33\.3333$"):
        replace(ASKED[0], fov_deg=33.3333333)
