"""Training and evaluation of a candidate in sim's worlds."""

import math
from dataclasses import replace

import numpy as np
import pytest

import sim
from evolve.config.run_config import WorldConfig
from evolve.learning import fitness
from evolve.learning.fitness import evaluate
from evolve.learning.played_episodes import play
from evolve.learning.policy import load_policy
from evolve.learning.training_rung import TrainingRung
from evolve.search.successive_halving import trained_steps
from sim.envs.prepared_task import PreparedTask
from tests.evolve.small_run import LEARNING, PHENOTYPE, small_config

pytestmark = pytest.mark.usefixtures("short_episodes")


@pytest.fixture(scope="module")
def outcome(tmp_path_factory, short_episodes):
    path = tmp_path_factory.mktemp("policy") / "0.safetensors"
    told = []
    return evaluate(PHENOTYPE, small_config(), 5, path, lambda *steps: told.append(steps)), path, told


def test_fitness_is_the_mean_return_of_the_evaluation_episodes(outcome):
    evaluation, _, _ = outcome
    assert len(evaluation.returns) == 6
    assert evaluation.fitness == pytest.approx(np.mean(evaluation.returns))
    assert evaluation.failure is None
    assert evaluation.steps == LEARNING.total_steps
    assert [steps for steps, _ in evaluation.curve] == [512]


def test_a_plan_counts_the_steps_that_are_trained(tmp_path):
    """The plan counts whole rollouts, 256 steps each, in two parts separated by an evaluation."""
    learning = replace(LEARNING, total_steps=600, eval_interval=300)
    config = small_config(learning=learning)
    trained = evaluate(PHENOTYPE, config, 5, tmp_path / "0.safetensors").steps
    assert trained == trained_steps(learning, 0, 600) == 768
    assert trained_steps(learning, 512, 600) == 768


def test_the_policy_is_as_wide_as_the_animals_brain(tmp_path):
    narrow = replace(PHENOTYPE, neurons=3, layers=1, encoder=2)
    evaluate(narrow, small_config(), 5, tmp_path / "0.safetensors")
    config = load_policy(tmp_path / "0.safetensors").config
    assert (config.neurons, config.layers, config.encoder) == (3, 1, 2)


def test_progress_is_told(outcome):
    assert outcome[2] == [(256, 512), (512, 512)]


def test_the_stored_policy_earns_the_same_returns(outcome):
    """The file contains the evaluated policy: in the same worlds it plays the same episodes."""
    evaluation, path, _ = outcome
    config = small_config()
    seed = int(np.random.SeedSequence(5).generate_state(3)[2])
    worlds = sim.make_vec_env(
        "detection", PHENOTYPE.eyes(config.eye), 6, seed, memory=3, mode="evaluation", rays_per_receptor=1
    )
    assert play(load_policy(path), worlds, seed).returns.tolist() == list(evaluation.returns)


def test_same_seed_same_life(outcome, tmp_path):
    evaluation, path, _ = outcome
    again = evaluate(PHENOTYPE, small_config(), 5, tmp_path / "again.safetensors")
    other = evaluate(PHENOTYPE, small_config(), 6, tmp_path / "other.safetensors")
    assert again.returns == evaluation.returns
    assert again.curve == evaluation.curve
    assert (tmp_path / "again.safetensors").read_bytes() == path.read_bytes()
    assert other.returns != evaluation.returns


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize(("most", "expected"), [(4096.0, None), (3.0, 3.0)])
@pytest.mark.parametrize("resolution", [(3, 4), (1, 1)])
def test_training_looks_less_closely_than_evaluation(resolution, most, expected, tmp_path, monkeypatch):
    """The setting limits the number of samples per receptor in training, whatever the eye. `expected` is None if the
    limit is above the number that the noise requires, 4 or 6 in the maze. Evaluations during training use as many
    samples as training. Fitness is always measured with the number that the noise requires. Light is the same in all
    three.
    """
    fidelities = []

    def recorded(make):
        def made(*args, **kwargs):
            worlds = make(*args, **kwargs)
            fidelities.append((worlds.simulation.task.mode, worlds.renderer.fidelity))
            return worlds

        return made

    monkeypatch.setattr(PreparedTask, "vec_env", recorded(PreparedTask.vec_env))
    config = small_config()
    learning = replace(config.learning, rays_per_receptor=most)
    config = replace(config, task="maze", eye=replace(config.eye, rays_per_receptor="auto"), learning=learning)
    animal = replace(PHENOTYPE, resolution=resolution)
    assert evaluate(animal, config, 5, tmp_path / "0.safetensors").failure is None
    (_, lessons), (_, checkpoints), (_, finals) = fidelities
    assert [mode for mode, _ in fidelities] == ["training", "evaluation", "evaluation"]
    assert finals.rays_per_receptor > 3
    assert lessons.rays_per_receptor == (expected or finals.rays_per_receptor)
    assert checkpoints == lessons == replace(finals, rays_per_receptor=lessons.rays_per_receptor)


def test_a_training_that_diverges_is_a_failure_with_a_reason(tmp_path, monkeypatch):
    """Signals are NaN: no exception is raised, and no policy is written."""
    monkeypatch.setattr(
        "sim.render.receptor_noise.NoiseModel.__call__", lambda _, signals, *__: np.full_like(signals, np.nan)
    )
    evaluation = evaluate(PHENOTYPE, small_config(), 5, tmp_path / "0.safetensors")
    assert evaluation.fitness == -math.inf
    assert evaluation.failure is not None
    assert "not finite" in evaluation.failure
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_unseen_mazes_are_seen_by_the_evaluation_alone(tmp_path):
    """The training is the same and the episodes after it differ. More mazes change the training."""
    outcomes = {}
    for name, world in {
        "one": WorldConfig(),
        "other": WorldConfig(unseen=True),
        "two": WorldConfig(mazes=2),
    }.items():
        config = replace(small_config(), task="maze", world=world)
        path = tmp_path / f"{name}.safetensors"
        outcomes[name] = evaluate(PHENOTYPE, config, 5, path).returns, path.read_bytes()
    (seen, taught), (unseen, taught_as_well), (_, of_two) = outcomes.values()
    assert taught == taught_as_well
    assert seen != unseen
    assert of_two != taught


@pytest.mark.slow
def test_every_stage_has_chance_of_its_own(tmp_path, monkeypatch):
    """A training run that continued in the worlds of its first rung would overfit to them."""
    seeds, make = [], fitness.worlds_of

    def recorded(phenotype, config, *two):
        seeds.append(two)
        return make(phenotype, config, *two)

    monkeypatch.setattr(fitness, "worlds_of", recorded)
    kept = tuple(tmp_path / str(number) for number in range(3))
    evaluate(PHENOTYPE, small_config(), 5, tmp_path / "policy", rung=TrainingRung((256, 512, 768), kept))
    assert len(seeds) == 3
    assert len({seed for two in seeds for seed in two}) == 6
    evaluate(PHENOTYPE, small_config(), 5, tmp_path / "whole")
    assert seeds[3] == seeds[0], "the first rung starts like a whole training run"
