"""Runs of an earlier format can be opened with their original meaning, but not continued."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evolve.config.assemble import assemble, from_text, from_toml, to_toml
from evolve.config.formats import FORMAT, LAST_OF_FORMER
from evolve.config.run_config import ConfigError
from evolve.episodes.episode_file import load_episode, save_episode
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
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


def of_format_2(config):
    """Return the text of a configuration of format 2."""
    return to_toml(config).replace(f"format = {FORMAT}\n", "format = 2\n").replace("pupil_turned = false\n", "")


@pytest.mark.parametrize("optics", [True, False])
def test_pupils_were_turned_until_format_2(optics):
    """They are also turned after the run was resumed, and if its configuration or one of its animals starts a run."""
    config = assemble("detection", assignments=[f"eye.optics={str(optics).lower()}"])
    assert not config.eye.pupil_turned
    former = from_text(of_format_2(config))
    assert former == replace(config, eye=replace(config.eye, pupil_turned=True))
    assert from_text(to_toml(former)) == former
    genome = Genotype(config.genome).start
    now, then = (develop(genome, each).eyes(each.eye) for each in (config, former))
    assert (now.pupil_turned, then.pupil_turned) == (False, optics)


def test_a_lopsided_animal_of_a_former_format_sees_as_before(tmp_path):
    """The kernel of its eyes is that of the same pupil, rotated by 180°: rows and columns are reversed."""
    relief = [f"genome.doe_{i}{j}.start={(3 * i + j * j) % 10 / 10}" for i in range(4) for j in range(4)]
    config = assemble("detection", assignments=relief)
    former = from_text(of_format_2(config))
    genome = Genotype(config.genome).start
    now, then = (develop(genome, each).eyes(each.eye).eye().kernel(2) for each in (config, former))
    np.testing.assert_allclose(then, now[:, ::-1, ::-1], rtol=0, atol=1e-5 * now.max())
    assert np.abs(then - now).max() > 0.05 * now.max()
    file = tmp_path / "config.toml"
    file.write_text(of_format_2(config))
    assert assemble("detection", file=file).eye.pupil_turned
    Run.create(tmp_path / "run", config)
    (tmp_path / "run/config.toml").write_text(of_format_2(config))
    Run.open(tmp_path / "run").require_present_light()


def test_episodes_without_the_setting_had_turned_pupils(tmp_path, episode):
    import json

    save_episode(episode, tmp_path / "now.npz")
    arrays = dict(np.load(tmp_path / "now.npz"))
    rest = json.loads(str(arrays["rest"]))
    assert rest["eye"].pop("pupil_turned") is episode.eye.pupil_turned is False
    np.savez(tmp_path / "then.npz", **(arrays | {"rest": np.array(json.dumps(rest))}))
    assert load_episode(tmp_path / "then.npz").eye.pupil_turned
    assert not load_episode(tmp_path / "now.npz").eye.pupil_turned


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
    with pytest.raises(ConfigError, match=r"mine\.toml: format = 1: must be 2 to 3"):
        assemble("maze", file=file)


def test_a_run_of_a_former_format_says_who_continues_it(tmp_path):
    shutil.copytree(RECORDS / "navigation-0", tmp_path / "run")
    run = Run.open(tmp_path / "run")
    assert run.config.task == "maze"
    with pytest.raises(
        RunError, match=rf"has format 1: must be 2 to {FORMAT} to be continued.* commit {LAST_OF_FORMER}"
    ):
        run.require_present_light()
    Run.create(tmp_path / "new", assemble("maze")).require_present_light()


def test_an_episode_recorded_in_a_maze_stays_there(tmp_path, episode):
    """Recordings without a course are older than courses."""
    import json

    arrays, rest = of_first_form(replace(episode, task="navigation"))
    arrays["objects"] = arrays["objects"][:, :0]
    np.savez(tmp_path / "then.npz", **arrays, rest=np.array(json.dumps(rest)))
    assert load_episode(tmp_path / "then.npz").task == "navigation"
    del rest["world"]["course"], rest["world"]["evaluation_course"]
    np.savez(tmp_path / "then.npz", **arrays, rest=np.array(json.dumps(rest)))
    assert load_episode(tmp_path / "then.npz").task == "maze"
