"""The pace is measured with real training, and an animal that cannot be evaluated is named."""

import os
from dataclasses import replace

import pytest

import evolve.cli.pace
from evolve.cli.pace import ROLLOUTS, Pace, _slowest, _timed_training, measure_pace
from evolve.config.run_config import ConfigError, LearningConfig
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.learning.fitness import evaluate
from evolve.learning.schedule import schedule
from evolve.search.job import ExecutorError
from evolve.store.evaluation import Evaluation
from optics.numerics import backend
from tests.evolve.small_run import PHENOTYPE, small_config


@pytest.mark.slow
def test_animal_that_cannot_be_evaluated_is_named():
    """A relief of seven millimetres is more than a hundred times as high as the pupil is wide."""
    backend.require()
    config = small_config()
    config = replace(config, eye=replace(config.eye, relief_height=1e-2))
    rough = (0.53, 0.2, 0.7, 0.22, 0.59, 0.31, 0.53, 0.39, 0.25, 0.45, 0.67, 0.59, 0.88, 0.53, 0.24, 0.56)
    blurred = replace(PHENOTYPE, fov_deg=13.8, relative_aperture=0.243, relief=rough, refractive_index=1.85)
    with pytest.raises(ConfigError, match="an animal like the middle one cannot be evaluated here: height"):
        measure_pace(config, {"middle": blurred}, 1)


def test_a_life_that_fails_says_why(monkeypatch, tmp_path):
    """The message gives the reason instead of a missing temporary file."""
    monkeypatch.setattr(evolve.cli.pace, "evaluate_candidate", lambda *_, **__: Evaluation.failed("weights are NaN"))
    with pytest.raises(ValueError, match=r"^weights are NaN$"):
        _timed_training(small_config(), PHENOTYPE, 0, tmp_path / "policy")


@pytest.mark.slow
def test_a_process_that_dies_is_told_in_one_line(monkeypatch):
    monkeypatch.setattr(evolve.cli.pace, "_timed_training", dies)
    monkeypatch.setattr(evolve.cli.pace, "prepare_device", None)
    with pytest.raises(ExecutorError, match=r"^a process that measured this machine's pace died.*or free some memory$"):
        measure_pace(small_config(), {"start": PHENOTYPE}, 1)


def dies(*_):
    os._exit(9)


@pytest.mark.slow
def test_pace_is_measured_with_the_real_thing(tmp_path, short_episodes):
    backend.require()
    config = small_config()
    animal = develop(Genotype(config.genome).start, config)
    learning = replace(config.learning, total_steps=64 * config.learning.n_envs * config.learning.n_steps)
    # the measured rollouts are too few for these rungs
    rungs = replace(config, learning=learning, search=replace(config.search, rungs=4))
    pace = measure_pace(rungs, {"start": animal}, 1)["start"]
    assert evaluate(animal, config, 0, tmp_path / "policy").failure is None
    assert pace.policy_bytes == (tmp_path / "policy").stat().st_size
    assert pace.steps_per_s > 0
    assert pace.start_s > 0


def test_the_slowest_of_many_lives_counts():
    lives = [Pace(start_s=1.0, steps_per_s=90.0, play_s=3.0, policy_bytes=7, pass_s=0.1), Pace(2.0, 50.0, 2.0, 7, 0.2)]
    assert _slowest(lives) == Pace(start_s=2.0, steps_per_s=50.0, play_s=3.0, policy_bytes=7, pass_s=0.1)


class Clock:
    """A machine on which starting takes 7 s, a step 0.001 s, a pass over the sample of a step 0.0002 s, and an
    evaluation 3 s.
    """

    now = 0.0

    def perf_counter(self):
        return self.now

    def evaluate(self, animal, config, seed, policy, progress):
        learning = config.learning
        rollout = learning.n_envs * learning.n_steps
        self.now += 7.0
        for steps in range(rollout, learning.total_steps + 1, rollout):
            self.now += 0.001 * rollout
            progress(steps, learning.total_steps)
            self.now += 0.0002 * schedule(learning, steps)[0] * rollout
            if steps % learning.eval_interval == 0:
                self.now += 3.0
        self.now += 3.0  # the evaluation of the trained policy
        policy.write_bytes(b"1234567")
        return Evaluation(1.0, (1.0,))


@pytest.mark.parametrize(("n_epochs", "least_epochs"), [(10, 3), (10, 6), (5, 1)])
def test_what_a_pass_takes_is_told_from_the_rest(monkeypatch, n_epochs, least_epochs, tmp_path):
    clock = Clock()
    monkeypatch.setattr(evolve.cli.pace, "time", clock)
    monkeypatch.setattr(evolve.cli.pace, "evaluate_candidate", clock.evaluate)
    learning = LearningConfig(n_epochs=n_epochs, least_epochs=least_epochs, total_steps=20 * 4096)
    config = replace(small_config(), learning=learning)
    pace = _timed_training(config, PHENOTYPE, 0, tmp_path / "policy")
    assert (pace.start_s, pace.play_s, pace.policy_bytes) == (pytest.approx(7), pytest.approx(3), 7)
    assert 1 / pace.steps_per_s == pytest.approx(0.001 + 0.0002 * n_epochs)
    slowing = replace(learning, decay_after=5 * 4096)
    passes = sum(schedule(slowing, number * 4096)[0] for number in range(1, 21))
    assert pace.training_s(slowing, 0, 20 * 4096) == pytest.approx(4096 * (20 * 0.001 + passes * 0.0002))


def test_a_pass_takes_no_more_than_the_whole(monkeypatch, tmp_path):
    """The machine is busy with other work at first."""

    class Busy(Clock):
        def evaluate(self, animal, config, seed, policy, progress):
            def later(steps, planned):
                progress(steps, planned)
                self.now += 1e3 * (steps == config.learning.total_steps // ROLLOUTS)

            return super().evaluate(animal, config, seed, policy, later)

    clock = Busy()
    monkeypatch.setattr(evolve.cli.pace, "time", clock)
    monkeypatch.setattr(evolve.cli.pace, "evaluate_candidate", clock.evaluate)
    config = replace(small_config(), learning=LearningConfig())
    pace = _timed_training(config, PHENOTYPE, 0, tmp_path / "policy")
    assert 0 < pace.training_s(config.learning, 0, 1_000_000) < 1_000_000 / pace.steps_per_s
