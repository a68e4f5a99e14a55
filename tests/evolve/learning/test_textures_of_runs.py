"""Textures in runs of user tasks: display colours, or as the run was recorded."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from evolve.config.assemble import assemble, from_text, to_toml
from evolve.config.numbering import Place
from evolve.config.run_config import ConfigError
from evolve.episodes.recorder import record
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.learning.animal_task import animal_task
from evolve.learning.fitness import evaluate
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from optics.numerics import backend
from sim.envs.prepared_task import PreparedTask
from sim.scene.color import decode_srgb

FLOOR = Path(__file__).parents[1] / "grey_floor.py"
SMALL = (
    *("learning.n_envs=8", "learning.n_steps=16", "learning.total_steps=128", "learning.batch_size=64"),
    *("learning.n_epochs=2", "learning.eval_interval=128", "evaluation.episodes=2", "eye.optics=false"),
    *("eye.noise_sigma=0", "genome.n_eyes.start=1"),
)


@pytest.fixture(scope="module", autouse=True)
def _device():
    backend.require()


def config_of(name="GreyFloor", *settings):
    return assemble(f"{FLOOR}:{name}", "quick", assignments=[*SMALL, *settings])


def older(config):
    """Return the configuration of a run that was recorded before the setting existed."""
    text = to_toml(config)
    assert "encoded_textures = true\n" in text
    return from_text(text.replace("encoded_textures = true\n", "")).with_code(f"{FLOOR}:{config.task_name}")


def brightness(config):
    """Return the mean signal of the first observation."""
    animal = develop(Genotype(config.genome).start, config)
    with closing(PreparedTask(animal_task(animal, config)).vec_env(1, 7, animal.memory_frames)) as worlds:
        return float(worlds.reset()["eyes"][0, -1].mean())


def test_older_runs_keep_their_light():
    """The eye sees nothing but the floor. The ratio of the signals is therefore that of 128/255 to the linear light of
    this level (IEC 61966-2-1).
    """
    now = config_of()
    assert not older(now).world.encoded_textures
    assert from_text(to_toml(older(now))).world == older(now).world
    assert brightness(older(now)) / brightness(now) == pytest.approx(128 / 255 / decode_srgb(128 / 255), rel=1e-3)
    assert brightness(config_of("GreyFloor", "world.encoded_textures=false")) == brightness(older(now))


def test_an_older_run_replays_as_it_was_recorded(tmp_path):
    """Without the former light, the signals would be darker by the factor 2.3."""
    then = older(config_of())
    animal, genome = develop(Genotype(then.genome).start, then), Genotype(then.genome).start
    run = Run.create(tmp_path / "run", then)
    outcome = evaluate(animal, then, 7, run.policy_path(0))
    run.append(Candidate.from_evaluation(Place(0, 0, 0), tuple(genome), animal, 7, outcome))
    text = (run.path / "config.toml").read_text()
    assert "encoded_textures = false\n" in text
    (run.path / "config.toml").write_text(text.replace("encoded_textures = false\n", ""))
    again = Run.open(run.path, task=f"{FLOOR}:GreyFloor")
    first, second = (record(each, 0, seed=3, radiance_every=100) for each in (run, again))
    np.testing.assert_array_equal(first.signals, second.signals)


def test_an_older_run_with_a_compiled_model_says_why_it_cannot_replay():
    then = older(config_of("CompiledFloor"))
    with pytest.raises(ConfigError, match=r"'grey' of a compiled model cannot request linear light.* because"):
        brightness(then)


def test_the_setting_is_for_user_tasks():
    assert from_text(to_toml(assemble("maze")).replace("encoded_textures = true\n", "")).world.encoded_textures
    with pytest.raises(ConfigError, match=r"world\.encoded_textures: is for user tasks, not for maze"):
        assemble("maze", assignments=["world.encoded_textures=false"])
