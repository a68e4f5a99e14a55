"""The plan of a user task's run takes few CPU seconds, and says what the start of the run would say."""

import random
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import evolve.cli.pace
from evolve.cli.pace import ROLLOUTS, _timed_training
from evolve.config.assemble import assemble
from evolve.config.run_config import LearningConfig
from evolve.learning.task_trial import UnusedSettingWarning
from evolve.runs.begin import RunRequest, check_task, prepare_run
from evolve.store.evaluation import Evaluation
from tests.evolve.small_run import PHENOTYPE, small_config

FIND_BALL = Path(__file__).parents[3] / "examples" / "find_ball.py"
HEAVY = ("torch", "mitsuba", "mujoco", "drjit", "nevergrad", "scipy", "optics.eye", "matplotlib")
PLAN = f"""
import sys
from evolve.cli import run_plan
run_plan.measure_pace = lambda config, animals, workers: dict.fromkeys(animals, run_plan.Pace(1, 1, 1, 1))
from evolve.cli.main import main
assert main(["run", {f"{FIND_BALL}:FindBall"!r}, "--preset", "quick", "--dry-run"]) == 0
assert not (found := sys.modules.keys() & {{*{HEAVY!r}}}), found
"""


def test_only_the_measuring_processes_load_large_libraries():
    """The command itself would otherwise take seconds to load them."""
    done = subprocess.run([sys.executable, "-c", PLAN], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("seed", range(3))
def test_the_measured_rollouts_are_the_shortest_of_whole_batches(seed, monkeypatch, tmp_path):
    draw, seen = random.Random(seed), []

    def evaluate(animal, config, seed, policy, progress):
        seen.append(config.learning)
        rollout = config.learning.n_envs * config.learning.n_steps
        for k in range(ROLLOUTS):
            progress((k + 1) * rollout, ROLLOUTS * rollout)
        policy.write_bytes(b"")
        return Evaluation(1.0, (1.0,))

    monkeypatch.setattr(evolve.cli.pace, "evaluate_candidate", evaluate)
    batch, n_envs, n_steps = draw.choice([64, 1024]), draw.choice([16, 48, 128]), 8 * draw.randint(1, 40)
    learning = LearningConfig(n_envs=n_envs, n_steps=n_steps, batch_size=batch, total_steps=10**6)
    _timed_training(replace(small_config(), learning=learning), PHENOTYPE, 0, tmp_path / "policy")
    rollout = seen[0].n_envs * seen[0].n_steps
    assert (seen[0].n_envs, seen[0].batch_size, seen[0].total_steps) == (n_envs, batch, ROLLOUTS * rollout)
    shorter = [n for n in range(2, n_steps) if n_envs * n % batch == 0]
    assert seen[0].n_steps == (shorter[0] if shorter else n_steps)


@pytest.fixture
def unused(tmp_path):
    """Return the path of a task with a setting that has no effect on a run."""
    text = FIND_BALL.read_text().replace("    episode_steps", '    auxiliary = ("depth",)\n    episode_steps', 1)
    (tmp_path / "balls.py").write_text(text)
    return tmp_path / "balls.py"


def test_the_task_is_tried_in_the_measuring_process(unused, monkeypatch):
    """The measuring process returns the warnings, and the command shows them."""
    config = assemble(f"{unused}:FindBall", "quick", assignments=["eye.optics=false", "eye.rays_per_receptor=1"])
    found = check_task(config)
    assert len(found) == len({*map(str, found)})
    unused_ones = [str(one) for one in found if isinstance(one, UnusedSettingWarning)]
    assert any("auxiliary = ('depth',) has no effect" in one for one in unused_ones)
    monkeypatch.setattr(evolve.runs.begin, "try_task", None)
    monkeypatch.setattr(evolve.runs.begin, "check_settings", None)
    prepare_run(RunRequest(f"{unused}:FindBall", "quick"), tried=False)
    with pytest.raises(evolve.ConfigError, match=r"search.optimizer = 'CMAE': must be CMA"):
        prepare_run(RunRequest("detection", "quick", assignments=["search.optimizer=CMAE"]), tried=False)


@pytest.mark.slow
def test_what_is_wrong_with_a_task_ends_the_plan_in_one_line(call, unused):
    named, quick = f"{unused}:FindBall", ("--preset", "quick", "--set", "workers=1", "--dry-run")
    code, _, err = call("run", named, *quick)
    assert code == 0
    assert "note: balls.py:FindBall: auxiliary = ('depth',) has no effect" in err
    unused.write_text(unused.read_text().replace("return {", "return 1 / 0 and {", 1))
    code, _, err = call("run", named, *quick)
    assert (code, err.count("evolve: error: balls.py:FindBall: ")) == (2, 1)
    assert "ZeroDivisionError" in err
