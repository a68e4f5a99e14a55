"""Layouts of training, selection and test: each mode uses its own set, and final figures use a set of their own."""

from dataclasses import replace

import numpy as np
import pytest

import evolve.learning.animal_task as animal_task_module
from evolve.config.assemble import assemble
from evolve.config.checks import ConfigError
from evolve.config.numbering import Place
from evolve.config.run_config import WorldConfig
from evolve.config.settings import FAMILY
from evolve.episodes.held_out import held_out_episodes
from evolve.episodes.recorder import record
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.learning.animal_task import animal_task
from evolve.learning.final_figures import final_episodes, require_test_set
from evolve.learning.fitness import evaluate
from evolve.learning.policy import load_policy
from evolve.learning.task_trial import check_layouts
from evolve.report.markup import rounded
from evolve.report.page import numbers_section
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from sim.worlds import layout_family
from sim.worlds.layout import CELL
from sim.worlds.layout_family import SETS, LayoutFamily
from tests.evolve.small_run import PHENOTYPE, small_config

pytestmark = pytest.mark.usefixtures("short_episodes")

SIZE = {"rows": 9, "columns": 17}
SMALL = WorldConfig(
    layouts=FAMILY, training_layouts=3, selection_layouts=2, test_layouts=2, layout_rows=9, layout_columns=17
)


def config_of(task, world=SMALL):
    return replace(small_config(), task=task, world=world)


@pytest.fixture(scope="module")
def played(tmp_path_factory, short_episodes):
    """A run with one candidate that was trained and evaluated in mazes of a family."""
    run = Run.create(tmp_path_factory.mktemp("family") / "run", config_of("maze"))
    outcome = evaluate(PHENOTYPE, run.config, 5, run.policy_path(0))
    genome = (0.5,) * Genotype(run.config.genome).dimension
    run.append(Candidate.from_evaluation(Place(0, 0, 0), genome, PHENOTYPE, 5, outcome))
    return run


@pytest.fixture
def built(monkeypatch):
    """The sets whose worlds are built, in order, each with the mode of its task."""
    found, build, task_of = [], animal_task_module.build_world, animal_task_module.task_of

    def recorded(task, **where):
        found.append(where["layouts"] and where["layouts"].name)
        return build(task, **where)

    def in_mode(world, mode, **settings):
        found[-1] = (found[-1], mode)
        return task_of(world, mode, **settings)

    monkeypatch.setattr(animal_task_module, "build_world", recorded)
    monkeypatch.setattr(animal_task_module, "task_of", in_mode)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("task", ["navigation", "maze"])
@pytest.mark.parametrize("judged", ["selection", "training"])
def test_each_mode_uses_its_own_set(task, judged, built, tmp_path):
    config = config_of(task, replace(SMALL, selection_set=judged))
    path = tmp_path / "0.safetensors"
    outcome = evaluate(PHENOTYPE, config, 5, path)
    assert outcome.failure is None
    # Without a separate set for selection, training uses the world that has been built for the evaluation.
    assert built == [(judged, "evaluation"), *([("training", "training")] if judged == "selection" else [])]
    built.clear()
    episodes = final_episodes(PHENOTYPE, config, load_policy(path), 5)
    assert built == [("test", "test")]
    assert len(episodes.returns) == 6


def test_held_out_episodes_are_those_of_the_test_mazes(played, built):
    """The same seed gives the same episodes. They take place in the walls of the test set."""
    first, again = held_out_episodes(played, episodes=4), held_out_episodes(played, episodes=4)
    assert first.returns.tolist() == again.returns.tolist()
    assert len(first.returns) == 4
    assert {name for name, _ in built} == {"test"}
    test, selection = (_boxes(mode, played) for mode in ("test", "evaluation"))
    assert test != selection
    assert _boxes_of_episode(record(played, seed=1, mode="test")) <= test
    assert _boxes_of_episode(record(played, seed=1)) <= selection


def _boxes(mode, run):
    model = animal_task(PHENOTYPE, run.config, mode).model
    walls = [i for i in range(model.ngeom) if model.geom(i).name.startswith("wall")]
    return {tuple(np.round(model.geom_pos[i][:2], 6)) for i in walls}


def _boxes_of_episode(episode):
    assert episode.mode in ("test", "evaluation")
    assert episode.plan.bounds[3] - episode.plan.bounds[1] == pytest.approx(9 * CELL)
    return {tuple(np.round(wall[:2], 6)) for wall in episode.plan.walls}


def test_the_report_states_the_return_in_the_test_set(played, run):
    shown = numbers_section(played).markup
    assert "Its return in the test layouts" in shown
    assert f"<dd>{rounded(held_out_episodes(played).returns.mean(), 4)}<small>mean of 6 episodes" in shown
    assert "test layouts" not in numbers_section(run).markup


def test_fixed_layouts_and_tasks_without_layouts_have_no_test_set(run, call):
    with pytest.raises(ConfigError, match="task = detection: has no test set: must be navigation or maze"):
        held_out_episodes(run)
    with pytest.raises(ConfigError, match=r"world\.layouts = fixed: has no test set, .* must be family"):
        require_test_set(assemble("maze"))
    code, out, err = call("replay", run.path, "--test")
    assert (code, out) == (2, "")
    assert err == "evolve: error: task = detection: has no test set: must be navigation or maze\n"


def test_a_user_task_can_tell_the_test_by_its_mode():
    config = assemble("examples/find_ball.py:FindBall", "quick")
    animal = develop(Genotype(config.genome).start, config)
    require_test_set(config)
    assert [animal_task(animal, config, mode).learners[0].mode for mode in ("training", "test")] == ["training", "test"]


@pytest.mark.parametrize(
    ("assignments", "message"),
    [
        (["world.layouts=families"], r"world\.layouts = 'families': must be one of fixed, family"),
        (["world.layouts=family", "world.training_layouts=0"], r"world\.training_layouts = 0: must be in \[1, 100\]"),
        (["world.layouts=family", "world.layout_rows=12"], r"world\.layout_rows = 12: must be odd, such as 11"),
        (["world.layouts=family", "world.layout_columns=13"], r"world\.layout_columns = 13: must be in \[15, 99\]"),
        (
            ["world.layouts=family", "world.selection_set=test"],
            r"selection_set = 'test': must be one of selection, tra",
        ),
        (["world.layouts=family", "world.unseen=true"], r"world\.unseen = true: has no effect with world\.layouts = f"),
        (["world.family_seed=2"], r"world\.family_seed = 2: has no effect with world\.layouts = fixed"),
        (["world.wall_height=0.1"], r"world\.wall_height = 0\.1: must be in \[0\.4, 100\]"),
    ],
)
def test_bad_settings_of_layouts_are_refused_in_one_line(assignments, message):
    with pytest.raises(ConfigError, match=message) as caught:
        assemble("maze", assignments=assignments)
    assert "\n" not in str(caught.value)


def test_layouts_are_for_navigation_and_mazes():
    with pytest.raises(ConfigError, match=r"world\.layouts: is for navigation and maze, not for tracking"):
        assemble("tracking", assignments=["world.layouts=family"])
    with pytest.raises(ConfigError, match=r"world\.wall_height: is for built-in tasks, not for find_ball"):
        assemble("examples/find_ball.py:FindBall", assignments=["world.wall_height=0.5"])
    assert assemble("detection", assignments=["world.wall_height=0.5"]).world.test["wall_height"] == 0.5


def test_limits_of_the_settings_are_those_of_families():
    from evolve.config.settings import SECTIONS

    valid = {name: field.metadata["valid"] for name, field in SECTIONS["world"].__dataclass_fields__.items()}
    rows, columns = ((valid[f"layout_{side}"].low, valid[f"layout_{side}"].high) for side in ("rows", "columns"))
    assert (rows, columns) == (layout_family.ROWS, layout_family.COLUMNS)
    for name in SETS:
        assert (valid[f"{name}_layouts"].low, valid[f"{name}_layouts"].high) == (1, layout_family.MOST_LAYOUTS)


def test_a_run_with_equal_layouts_does_not_start(monkeypatch):
    monkeypatch.setattr(
        layout_family, "_DRAW", {"maze": lambda family, rng: np.ones((family.rows, family.columns), bool)}
    )
    layout_family._drawn.cache_clear()
    with pytest.raises(ConfigError, match="world: LayoutFamily: layouts training 0 and training 1 have the same walls"):
        check_layouts(config_of("maze", replace(SMALL, family_seed=77)))
    check_layouts(small_config())


def test_settings_reach_the_family():
    world = replace(SMALL, family_seed=4)
    expected = LayoutFamily(4, n_training=3, n_selection=2, n_test=2, **SIZE)
    assert world.training["layouts"] == expected.training
    assert world.evaluation["layouts"] == expected.selection
    assert world.test["layouts"] == expected.test
    fixed = WorldConfig(mazes=2, unseen=True)
    assert fixed.test == fixed.evaluation
