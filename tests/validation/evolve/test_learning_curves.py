"""The page agrees with its store."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv

import sim
from evolve.config.run_config import LearningConfig
from evolve.learning.policy import PolicyConfig
from validation.evolve import learning_curves
from validation.evolve.watched_trainings import Case, Journey, Row, read_rows, steps_to, watched, wilson, write_rows

ROOT = Path(__file__).parents[3]
ROW = Row("detection, 2 x (15 x 15)", 0, 50_000, 10.0, 4.0, 30, 60, 100, 1.5, 0.1, 20.0, 7.0, 0.3)


class Walkers(VecEnv):
    """Two walkers that move along x. Every second action causes a contact, and the first walker's episodes take two
    actions."""

    def __init__(self):
        super().__init__(2, PolicyConfig((1, 1, 1, 1, 1), 1).observation_space(), spaces.Box(-1, 1, (2,)))
        self.state = SimpleNamespace(start=np.array([[3.0, 4.0], [3.0, 4.0]]))

    def reset(self):
        self.x, self.steps = np.array([3.0, 3.0]), 0

    def step_async(self, actions):
        self.x, self.steps = self.x + 1, self.steps + 1

    def step_wait(self):
        touching = -1.0 if self.steps % 2 else 0.0
        infos = [{"position": (x, 4.0), "reward_terms": {"contact": touching}} for x in self.x]
        done = np.array([self.steps % 2 == 0, False])
        self.x = np.where(done, 3.0, self.x)
        return None, np.zeros(2), done, infos

    def close(self): ...

    def get_attr(self, *_):
        return [None, None]

    def set_attr(self, *_): ...

    def env_method(self, *_): ...

    def env_is_wrapped(self, *_): ...


def learning(case, *goals, seed=0):
    return [replace(ROW, case=case, seed=seed, steps=50_000 * (i + 1), goals=n) for i, n in enumerate(goals)]


def test_wilson_interval():
    """The interval for 81 of 263 is 0.2553 to 0.3662 (Newcombe 1998, table I)."""
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert wilson(0, 20)[0] == pytest.approx(0, abs=1e-12)


def test_first_evaluation_that_solves_counts():
    rows = learning("a", 30, 80, 70, 90)
    assert steps_to(rows, 0.8) == rows[1]
    assert steps_to(rows, 0.95) is None


def test_rows_survive_the_file(tmp_path):
    rows = [ROW, replace(ROW, case='with, "quotes"', cpu_seconds=0.1)]
    write_rows(rows, tmp_path / "a" / "b.csv")
    assert read_rows(tmp_path / "a" / "b.csv") == rows
    assert read_rows(tmp_path / "none.csv") == []


def test_verdicts_name_what_is_not_learnt():
    solved, stuck = learning("detection, 2 x (15 x 15)", 50, 85), learning("tracking, 2 x (15 x 15)", 50, 60)
    cheating = learning("detection, 1 receptor", 60)
    chance = learning("tracking, 1 receptor", 38)
    assert learning_curves.verdicts([*solved, *stuck, *cheating, *chance]) == [
        "detection, 1 receptor, seed 0: better than chance",
        "tracking, seed 0: not solved",
    ]


def test_ten_eyes_must_beat_one_by_more_than_chance():
    """A distance of 10 m with 2 contacts gives the fitness 1.5 x 10 - 2 x 2 = 11. Standard errors of 0.3 m of the
    distance and 0.1 of the return give at most 1.5 x 0.3 + 2 x (0.25 x 0.3 + 0.1) = 0.8. The standard error of a
    difference is then 1.13 and its 95 % limit 2.22; for distances the limit is 0.83 m.
    """
    many = replace(ROW, case="maze, 10 x (1 x 4)", goals=0, contacts=2.0, distance=10.0)
    one = replace(many, case="maze, 1 x (1 x 4)", contacts=2.4, distance=9.0)
    assert learning_curves.verdicts([many, one]) == []  # 8.7 and 9 m
    assert learning_curves.verdicts([many, replace(one, contacts=1.8, distance=9.3)]) == [
        "maze, seed 0: ten eyes do not beat one (fitness)",
        "maze, seed 0: ten eyes do not beat one (distance)",
    ]
    line = learning_curves.table([many])
    for shown in ("1.50 ± 0.20", "11.0 ± 1.6", "10.0 ± 0.6"):
        assert shown in line


def test_a_journey_ends_where_its_first_episode_ends():
    """Animals in two worlds walk 1 m per action from (3, 4). In the first world, the episode ends after two actions and
    a new one begins.
    """
    worlds = Journey(Walkers())
    worlds.reset()
    for _ in range(4):
        worlds.step(np.zeros((2, 2)))
    assert worlds.distance.tolist() == [2.0, 4.0]
    assert worlds.contacts.tolist() == [1, 2]


def test_a_training_is_watched():
    """The training has two rollouts and two evaluations. The eye is so small that the test takes seconds."""
    learning = LearningConfig(total_steps=512, n_envs=16, n_steps=16, batch_size=64, eval_interval=256)
    case = Case("x", sim.Eyes(n_eyes=1, resolution=(1, 2)), learning=learning, memory=2, neurons=8, episodes=8)
    rows = list(watched(case, seed=3))
    assert [row.steps for row in rows] == [256, 512]
    for row in rows:
        assert 0 <= row.goals + row.adversaries <= row.episodes == 8
        assert 0 < row.update_seconds < row.cpu_seconds
    assert rows[0].cpu_seconds < rows[1].cpu_seconds


def test_page_is_the_stores(tmp_path):
    stored = ROOT / learning_curves.STORED
    learning_curves.main(["--stored", str(stored), "--out", str(tmp_path), "--docs", str(tmp_path)])
    page = (ROOT / "docs/validation/learning_curves.md").read_text(encoding="utf-8")
    assert (tmp_path / "learning_curves.md").read_text(encoding="utf-8") == page
