"""Two animals of one world evolve in turn: one against the best animal of the other's run, which is frozen."""

import shutil
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import evolve
import sim
from evolve.config.assemble import assemble
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.learning.fitness import evaluate
from evolve.learning.task_module import executed_task
from evolve.learning.task_trial import try_task
from evolve.store.directory import RunError
from optics.numerics import backend

EXAMPLE = Path(__file__).parents[3] / "examples" / "front_or_side.py"
SEARCH = {"search.generations": 1, "search.population": 2, "evaluation.episodes": 4, "workers": 1}
ANIMAL = {"eye.optics": False, "genome.memory_frames.start": 3, "genome.memory_frames.open": False}
WORLDS = {"learning.n_envs": 8, "learning.n_steps": 16, "learning.total_steps": 256, "learning.eval_interval": 128}
TINY = SEARCH | ANIMAL | WORLDS | {"learning.batch_size": 64, "learning.n_epochs": 2}
HUNTER = """
from pathlib import Path

import evolve
from front_or_side import Predator, Prey, from_predator


class Hunter(Predator):
    others = (evolve.Run.open(Path(__file__).parent / "prey").frozen(Prey()),)

    def rewards(self, data):
        return {"near": -sum(from_predator(data) ** 2) / 1000}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the example, a run of its prey, and a predator that plays against the best prey."""
    backend.require()
    folder = tmp_path_factory.mktemp("turns")
    shutil.copy(EXAMPLE, folder)
    (folder / "hunter.py").write_text(HUNTER)
    evolve.run(f"{folder / EXAMPLE.name}:Prey", settings=TINY, out=folder / "prey", progress=False)
    return folder


def lived(named):
    config = assemble(named, assignments=[f"{key}={str(value).lower()}" for key, value in TINY.items()])
    return config, develop(Genotype(config.genome).start, config)


@pytest.mark.slow
def test_a_frozen_animal_is_the_runs_best(folder):
    """The frozen animal has the run's eyes, memory and policy, on the given body."""
    run = evolve.Run.open(folder / "prey")
    frozen = run.frozen(executed_task(lived(f"{folder / EXAMPLE.name}:Prey")[0].choice.named_code))
    best = run.best.phenotype
    assert len(frozen.task.mounts) == best.n_eyes
    assert frozen.task.eye.resolution == best.resolution
    assert frozen.memory == best.memory_frames == 3
    assert frozen.task.others == ()
    stored = evolve.load_policy(run.policy_path(run.best.id))
    tensors = stored.state_dict()
    assert all((tensor == tensors[name]).all() for name, tensor in frozen.policy.state_dict().items())
    with pytest.raises(RunError, match="7"):
        run.frozen(sim.Task(), 7)


@pytest.mark.slow
def test_the_other_evolves_before_it(folder):
    """The training run of the hunter differs with prey that stands still, and is reproducible."""
    config, animal = lived(f"{folder / 'hunter.py'}:Hunter")
    try_task(config)
    lives = [evaluate(animal, config, 3, folder / name) for name in ("one", "two")]
    assert lives[0].failure is None
    assert lives[0].returns == lives[1].returns
    [prey] = executed_task(config.choice.named_code).others
    worlds = sim.make_vec_env(with_policy(config, prey.policy), n_envs=4, seed=0)
    idle = sim.make_vec_env(with_policy(config, None), n_envs=4, seed=0)
    with closing(worlds), closing(idle):
        moved = []
        for each in (worlds, idle):
            each.reset()
            for _ in range(3):
                each.step(np.zeros((4, 1)))
            moved.append(np.abs([data.qpos[:2] for data in each.worlds.datas]).max())
    assert moved[0] > 1e-4
    assert moved[1] == 0


def with_policy(config, policy):
    task = executed_task(config.choice.named_code)
    task = type(task)()
    task.others = (sim.Frozen(task.others[0].task, policy),)
    return task


def test_rays_of_frozen_animals_are_chosen_once(folder):
    """They are not chosen again in each of an animal's three environments."""
    given = "    fidelity = sim.Fidelity(2, bands=4)\n"
    text = (folder / EXAMPLE.name).read_text()
    assert given in text
    (folder / "auto.py").write_text(text.replace(given, "", 1))  # the predator's fidelity
    config, _ = lived(f"{folder / 'auto.py'}:Prey")
    [predator] = executed_task(config.choice.named_code).others
    assert isinstance(predator.task.fidelity, sim.Fidelity)
    assert "moments" in predator.task.fidelity.levels[-1].why


def test_what_is_wrong_with_others_is_told_before_a_run(folder):
    (folder / "alike.py").write_text(
        HUNTER.replace("class Hunter(Predator):", "class Hunter(Predator):\n    name = 'Prey'")
    )
    config, _ = lived(f"{folder / 'alike.py'}:Hunter")
    with pytest.raises(evolve.ConfigError, match="Hunter: others: two animals are called 'Prey': must differ"):
        try_task(config)
    (folder / "lost.py").write_text(HUNTER.replace('/ "prey"', '/ "pray"'))
    config, _ = lived(f"{folder / 'lost.py'}:Hunter")
    with pytest.raises(evolve.ConfigError, match=r"lost.py: line \d+: RunError: .*pray"):
        try_task(config)
