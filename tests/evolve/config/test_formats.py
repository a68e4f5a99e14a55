"""Runs of an earlier format can be opened with their original meaning, but not continued."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from evolve.analysis.episode_file import load_episode
from evolve.config.assemble import assemble, from_text, from_toml, to_toml
from evolve.config.formats import FORMAT, LAST_OF_FORMER
from evolve.config.run_config import ConfigError
from evolve.store.directory import Run, RunError
from tests.evolve.first_form import of_first_form

RECORDS = Path(__file__).parents[3] / "experiments/records"
FORMER = 'task = "navigation"\n[world]\nmazes = 3\n[learning]\nrays_per_eye = 32.0\ngamma = 0.5\n'


def test_what_is_written_names_its_format_and_is_read_back():
    config = assemble("navigation", assignments=["world.course=long"])
    assert to_toml(config).startswith(f"format = {FORMAT}\n")
    assert from_text(to_toml(config)) == config


def test_navigation_was_a_maze():
    config = from_text(FORMER)
    assert (config.task, config.world.mazes, config.learning.gamma) == ("maze", 3, 0.5)
    assert from_text(FORMER.replace("navigation", "detection").replace("[world]\nmazes = 3\n", "")).task == "detection"


def test_a_format_of_the_future_is_refused():
    with pytest.raises(ConfigError, match=f"format = 9: must be a whole number up to {FORMAT}"):
        from_text("format = 9\n" + FORMER)


def test_runs_that_say_nothing_of_fewer_passes_made_none_fewer():
    config = assemble("navigation", assignments=["learning.n_epochs=7"])
    assert config.learning.least_epochs == 3
    silent = to_toml(config).replace("least_epochs = 3\n", "")
    assert from_text(silent).learning.least_epochs == 7
    assert from_toml(RECORDS / "navigation-0" / "config.toml").learning.least_epochs == 8
    with pytest.raises(ConfigError, match="rays_per_eye"):
        from_text(silent.replace("n_epochs = 7", "n_epochs = 7\nrays_per_eye = 32.0"))


def test_runs_that_say_nothing_of_active_searches_had_one():
    config = assemble("navigation")
    assert not config.search.active
    assert from_text(to_toml(config)) == config
    assert from_text(to_toml(config).replace("active = false\n", "")).search.active
    assert from_toml(RECORDS / "navigation-0" / "config.toml").search.active


def test_what_somebody_asks_for_is_of_this_format(tmp_path):
    """A file without a format number is a user's configuration and not a run. The whole config.toml of another run is
    also accepted.
    """
    file = tmp_path / "mine.toml"
    file.write_text('task = "navigation"\n')
    assert assemble(file=file).task == "navigation"
    file.write_text(to_toml(assemble("maze")))
    assert assemble(file=file) == assemble("maze") == from_toml(file)
    file.write_text("format = 1\n")
    with pytest.raises(ConfigError, match=r"mine\.toml: format = 1: must be 2"):
        assemble("maze", file=file)


def test_a_run_of_a_former_format_says_who_continues_it(tmp_path):
    shutil.copytree(RECORDS / "navigation-0", tmp_path / "run")
    run = Run.open(tmp_path / "run")
    assert run.config.task == "maze"
    with pytest.raises(RunError, match=rf"has format 1: must be {FORMAT} to be continued.* commit {LAST_OF_FORMER}"):
        run.require_present_format()
    Run.create(tmp_path / "new", assemble("maze")).require_present_format()


def test_an_episode_recorded_in_a_maze_stays_there(tmp_path, episode):
    """Recordings without a course are older than courses."""
    import json

    import numpy as np

    arrays, rest = of_first_form(replace(episode, task="navigation"))
    arrays["objects"] = arrays["objects"][:, :0]
    np.savez(tmp_path / "then.npz", **arrays, rest=np.array(json.dumps(rest)))
    assert load_episode(tmp_path / "then.npz").task == "navigation"
    del rest["world"]["course"], rest["world"]["evaluation_course"]
    np.savez(tmp_path / "then.npz", **arrays, rest=np.array(json.dumps(rest)))
    assert load_episode(tmp_path / "then.npz").task == "maze"
