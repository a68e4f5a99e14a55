"""Execution of user tasks: the environment of an animal, and tasks that are refused at the start."""

import dataclasses
import pickle
import re
import warnings
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import sim
from evolve.config.assemble import assemble, to_toml
from evolve.config.run_config import ConfigError
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.learning.animal_task import animal_task
from evolve.learning.fitness import evaluate
from evolve.learning.observed import Entry
from evolve.learning.policy import TrainingDiverged, load_policy
from evolve.learning.task_module import executed_task
from evolve.learning.task_trial import try_task
from evolve.learning.training_envs import worlds_of
from evolve.search import dask_worker
from evolve.search.job import Job
from evolve.search.worker import evaluate_candidate
from evolve.store.evaluation import Evaluation
from optics.numerics import backend

BALL = Path(__file__).parents[3] / "examples" / "find_ball.py"
SMALL = (
    *("learning.n_envs=8", "learning.n_steps=16", "learning.total_steps=256", "learning.batch_size=64"),
    *("learning.n_epochs=2", "learning.eval_interval=128", "evaluation.episodes=3", "eye.optics=false"),
    "genome.n_eyes.start=2",
)


@pytest.fixture(scope="module", autouse=True)
def _device():
    backend.require()


def small(*settings, named=f"{BALL}:FindBall"):
    config = assemble(named, "quick", assignments=[*SMALL, *settings])
    return config, develop(Genotype(config.genome).start, config)


def written(tmp_path, old, new):
    """Return our task with an error in it."""
    text = BALL.read_text()
    assert old in text
    file = tmp_path / "mine.py"
    file.write_text(text.replace(old, new))
    return f"{file}:FindBall"


def test_an_animal_lives_in_it_twice_alike(tmp_path):
    config, animal = small()
    first, second = (evaluate(animal, config, 3, tmp_path / name) for name in ("first", "second"))
    assert first.failure is None
    assert first.returns == second.returns
    assert first.steps == 256
    assert (tmp_path / "first").read_bytes() == (tmp_path / "second").read_bytes()
    policy = load_policy(tmp_path / "first")
    assert (policy.config.actions, policy.config.beside) == (1, (Entry("feels", 1),))
    # The first observation, and all proprioception until the better of two evaluations.
    assert policy.features_extractor.felt.seen.item() in (8 + 128, 8 + 256)


BATCH = """
import numpy as np
import sim
from pathlib import Path

class FindBalls(sim.BatchTask):
    model = {model!r}
    mounts = (sim.Mount("cart", offset=(0.26, 0, 0.12)),)
    fidelity = sim.Fidelity(2, bands=4)
    episode_steps = 20

    def reset(self, worlds, chosen, rngs):
        worlds.mocap_pos[chosen, 0, 1] = [rng.uniform(-2, 2) for rng in rngs]

    def rewards(self, worlds):
        return {{"near": -np.abs(worlds.mocap_pos[:, 0, 1] - worlds.qpos[:, 0]) / 10}}

    def succeeded(self, worlds):
        return np.abs(worlds.mocap_pos[:, 0, 1] - worlds.qpos[:, 0]) < 0.3

    def proprioception(self, worlds):
        return worlds.qvel
"""


def test_a_batch_task_evolves_as_the_same_task_of_one_world_at_a_time(tmp_path):
    """Returns and the policy's bytes are the same."""
    file = tmp_path / "balls.py"
    file.write_text(BATCH.format(model=executed_task(small()[0].choice.named_code).model))
    lives = []
    for named in (f"{BALL}:FindBall", f"{file}:FindBalls"):
        config, animal = small(named=named)
        try_task(config)
        lives.append(evaluate(animal, config, 3, tmp_path / named.rpartition(":")[2]))
    single, batch = lives
    assert single.failure is None
    assert batch.returns == single.returns
    assert batch.success_rate == single.success_rate
    assert (tmp_path / "FindBalls").read_bytes() == (tmp_path / "FindBall").read_bytes()


def test_eyes_are_the_animals_own_where_the_task_puts_them():
    config, animal = small("genome.elevation_deg.start=20", "genome.placement_range_deg.start=80")
    task = animal_task(animal, config).task
    assert [mount.azimuth_deg for mount in task.mounts] == [40, -40]
    assert {mount.elevation_deg for mount in task.mounts} == {20}
    assert np.hypot(*task.mounts[0].offset[:2]) == pytest.approx(0.26)  # at the same distance, rotated with the eye
    assert task.eye.resolution == animal.resolution
    assert task.eye.noise_sigma == config.eye.noise_sigma
    plain = executed_task(config.choice.named_code)
    assert len(plain.mounts) == 1  # the class's own settings stay unchanged


def test_rays_are_the_runs_or_the_tasks_and_few_in_lessons():
    worlds = {}
    for rays in ("auto", "12"):
        config, animal = small(f"eye.rays_per_receptor={rays}", "learning.rays_per_receptor=1")
        life = worlds_of(animal, config, 1, 2)
        with closing(life.training), closing(life.selection), closing(life.fitness):
            worlds[rays] = [
                part.renderer.fidelity.rays_per_receptor for part in (life.training, life.selection, life.fitness)
            ]
    assert worlds == {"auto": [1, 1, 2], "12": [1, 1, 12]}


def test_what_eyes_do_not_see_of_a_model_is_said_before_and_not_by_every_candidate(tmp_path):
    mirror = (
        '<asset><material name="mirror" reflectance=".9"/></asset>'
        '<worldbody><geom type="box" size=".1 .1 .1" pos="5 5 .1" material="mirror"/>'
    )
    config, animal = small(named=written(tmp_path, "<worldbody>", mirror))
    with pytest.warns(sim.MirrorWarning, match="eyes do not see: reflections"):
        try_task(config)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        outcome = evaluate_candidate(animal, config, 3, tmp_path / "policy", progress=lambda *_: None)
    assert outcome.failure is None


def test_success_is_what_holds_at_the_end(tmp_path):
    """A task that succeeds in its first step, and is undone later, is not solved."""
    began = "return data.time < 0.15"
    named = written(tmp_path, "return abs(data.mocap_pos[0, 1] - data.qpos[0]) < 0.3", began)
    config, animal = small(named=named)
    assert evaluate(animal, config, 3, tmp_path / "early").success_rate == 0
    config, animal = small(named=written(tmp_path, "return abs(data.mocap_pos[0, 1] - data.qpos[0]) < 0.3", "return 1"))
    assert evaluate(animal, config, 3, tmp_path / "always").success_rate == 1


def test_what_fails_in_the_middle_of_a_life_is_counted(tmp_path):
    """Every episode fails at its 11th action. These are 2 episodes in each of 8 worlds during 32 actions of learning,
    and 3 episodes in each of three evaluations, two during training and one at the end.
    """
    config, animal = small(named=written(tmp_path, "    def succeeded", FAILING))
    with pytest.warns(UserWarning, match=r"terminated, line \d+ of mine.py: KeyError: 'ball'; its episode ends here"):
        outcome = evaluate(animal, config, 3, tmp_path / "policy")
    assert outcome.failure is None
    assert outcome.steps == 256
    ((said, episodes),) = outcome.episode_failures
    assert re.fullmatch(r"terminated, line \d+ of mine.py: KeyError: 'ball'", said)
    assert episodes == 8 * 2 + (1 + 1 + 1) * 3
    reply = dask_worker._text(outcome), b"", b""
    assert dask_worker.decode(reply)[0] == outcome


def test_what_failed_before_learning_diverged_is_counted_too(tmp_path, monkeypatch):
    def diverges(*_):
        raise TrainingDiverged("signals not finite")

    monkeypatch.setattr("evolve.learning.fitness.play", diverges)
    config, animal = small(named=written(tmp_path, "    def succeeded", FAILING))
    with pytest.warns(UserWarning, match="its episode ends here"):
        outcome = evaluate(animal, config, 3, tmp_path / "policy")
    assert outcome.failure == "signals not finite"
    assert [episodes for _, episodes in outcome.episode_failures] == [8 * 2 + (1 + 1) * 3]


FAILING = """    def terminated(self, data):
        return {}["ball"] if data.time > 1.05 else False

    def succeeded"""


def test_a_job_carries_the_text_as_it_was(tmp_path):
    """Edits of the file during a run do not affect the run."""
    file = tmp_path / "mine.py"
    file.write_text(BALL.read_text())
    config, animal = small(named=f"{file}:FindBall")
    job = Job(0, animal, config, 1, tmp_path / "policy")
    file.write_text("raise SystemError\n")
    assert executed_task(job.arguments[1].choice.named_code).episode_steps == 20


def test_dask_is_sent_the_text(tmp_path):
    """A remote worker has neither the run's directory nor the file."""
    file = tmp_path / "mine.py"
    file.write_text(BALL.read_text())
    config, animal = small(named=f"{file}:FindBall")
    order = dask_worker.encode(Job(0, animal, config, 1, tmp_path / "policy"), to_toml(config), "", "", "")
    file.unlink()
    given = []

    def live(phenotype, config, *rest, progress):
        given.append(executed_task(config.choice.named_code).episode_steps)
        return Evaluation(1.0, (1.0,))

    dask_worker._evaluate(live, pickle.loads(pickle.dumps(order)), lambda *_: None)
    assert given == [20]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("import sim\n", "import sim\nimport nowhere\n", r"mine\.py: line \d+: ModuleNotFoundError: No module named"),
        ("import sim\n", "import sim\nimport sys\nsys.exit(3)\n", r"^mine\.py: line \d+: SystemExit: 3$"),
        (
            "    episode_steps",
            "    def __init__(self): raise SystemExit\n    episode_steps",
            r"FindBall: line \d+: SystemExit",
        ),
        ("class FindBall(sim.Task)", "class FindBall", "must be a class that derives from sim.Task"),
        ("    episode_steps", "    def __init__(self, a): ...\n    episode_steps", "TypeError"),
        ("<mujoco>", "<mujoko>", "mujoko"),
        ("episode_steps = 20", "episode_steps = 0", r"episode_steps = 0: must be"),
        ('sim.Mount("cart"', 'sim.Mount("kart"', "no site or camera or body 'kart' in the model; did you mean 'cart'"),
        (
            "offset=(0.26, 0, 0.12)",
            "offset=(0, 0, 0)",
            r"FindBall: mounts\[0\] on 'cart': in the reference pose of the model",
        ),
        ('{"near": ', '{"near": 0 * ', None),
        ('{"near": -abs(data.mocap_pos[0, 1] - data.qpos[0]) / 10}', "data.qpos", "must be numbers by name"),
        ("rng.uniform(-2, 2)", "rng.uniform()[3]", r"reset, line \d+ of mine\.py"),
        ("return data.qvel", "return 1 / 0", "ZeroDivisionError"),
    ],
)
def test_what_would_fail_in_every_animal_is_refused_before_anything_begins(old, new, words, tmp_path):
    config, _ = small(named=written(tmp_path, old, new))
    if words is None:
        try_task(config)
        return
    with pytest.raises(ConfigError, match=words) as caught:
        try_task(config)
    assert "\n" not in str(caught.value)


def test_place_must_give_as_many_eyes_as_the_animal_has(tmp_path):
    text = (
        "    def place(self, n_eyes, placement_range_deg, elevation_deg):\n        return self.mounts\n\n    def reset("
    )
    config, _ = small(named=written(tmp_path, "    def reset(", text))
    with pytest.raises(ConfigError, match=r"FindBall: place returned .*: must be 2 of sim\.Mount"):
        try_task(config)


def test_a_place_that_fails_is_named(tmp_path):
    text = "    def place(self, n_eyes, *where):\n        return {1: ()}[n_eyes]\n\n    def reset("
    config, _ = small(named=written(tmp_path, "    def reset(", text))
    with pytest.raises(ConfigError, match="FindBall: place: KeyError: 2"):
        try_task(config)


def test_of_a_stranger_nothing_is_executed():
    config, animal = small()
    stranger = dataclasses.replace(config, code=None)
    with pytest.raises(ConfigError, match="runs only if you name it"):
        worlds_of(animal, stranger, 1, 2)
