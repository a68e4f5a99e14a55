"""Damaged and foreign checkpoints are set aside with one line, and the record is that of an undisturbed run."""

import random
import warnings
from dataclasses import replace

import pytest

from evolve.config.assemble import assemble, to_toml
from evolve.config.run_config import EvaluationConfig, LearningConfig
from evolve.learning.checkpoint import load_checkpoint, save_checkpoint
from evolve.learning.checkpoint_file import CheckpointError, CheckpointWarning
from evolve.learning.fitness import evaluate
from evolve.learning.training_rung import TrainingRung
from evolve.search import dask_worker
from evolve.search.job import Job
from evolve.search.loop import evolve
from evolve.search.worker import evaluate_candidate
from evolve.store.directory import Run
from tests.evolve.learning.damaged_checkpoints import DAMAGES, flipped_bit
from tests.evolve.search.kills import Nobody, history
from tests.evolve.search.training_kills import SMALL, Learning
from tests.evolve.small_run import PHENOTYPE, small_config

pytestmark = pytest.mark.usefixtures("short_episodes")
ENDS = (64, 128)
SEED = 5
OF_THE_NETWORK = [f"{kind} tensor, with a checksum" for kind in ("a missing", "a foreign", "a misshapen")]


def config():
    """Return settings with the shortest training that has two rungs."""
    plain = small_config()
    learning = LearningConfig(total_steps=128, n_envs=4, n_steps=16, batch_size=64, n_epochs=1, eval_interval=64)
    evaluation, search = EvaluationConfig(episodes=2), replace(plain.search, rungs=2)
    return replace(plain, learning=learning, evaluation=evaluation, search=search)


def rung_in(folder, number):
    kept = tuple(folder / f"{i}.safetensors" for i in range(number + 1))
    return TrainingRung(ENDS[: number + 1], kept, candidate=3)


def trained(folder, number, seed=SEED, phenotype=PHENOTYPE, settings=None):
    """Train a rung in a folder, and return everything that a record or a policy would show."""
    policy = folder / "policy"
    outcome = evaluate(phenotype, settings or config(), seed, policy, rung=rung_in(folder, number))
    return replace(outcome, seconds=0.0), policy.read_bytes()


@pytest.fixture(scope="module")
def first(tmp_path_factory, short_episodes):
    """Return the bytes of the checkpoint of the first rung."""
    folder = tmp_path_factory.mktemp("first")
    trained(folder, 0)
    return (folder / "0.safetensors").read_bytes()


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory, first):
    folder = tmp_path_factory.mktemp("undisturbed")
    (folder / "0.safetensors").write_bytes(first)
    with warnings.catch_warnings():
        warnings.simplefilter("error", CheckpointWarning)
        return trained(folder, 1)


def owner(number=0, seed=SEED, phenotype=PHENOTYPE, settings=None, candidate=3):
    rung = TrainingRung(ENDS, (None, None), candidate)
    return rung.owners(phenotype, settings or config(), seed)[number]


# Real training for each way in which a checkpoint is refused: by its bytes, by its numbers, and by the network. Every
# damage is detected in the next test.
@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("damage", ["a flipped bit", "steps of 0, with a checksum", *OF_THE_NETWORK])
def test_a_damaged_checkpoint_is_set_aside_and_the_record_is_the_same(damage, tmp_path, first, undisturbed):
    kept = tmp_path / "0.safetensors"
    bad = DAMAGES[damage](first, random.Random(damage))
    kept.write_bytes(bad)
    with pytest.warns(CheckpointWarning) as said:
        outcome = trained(tmp_path, 1)
    assert outcome == undisturbed
    assert len(said) == 1
    words = str(said[0].message)
    assert words.startswith(f"{kept}: it")
    assert words.endswith("it is renamed to 0.safetensors.unused, and its candidate is trained again")
    assert "\n" not in words
    assert (tmp_path / "0.safetensors.unused").read_bytes() == bad
    assert kept.read_bytes() == first, "the training from the start leaves the same checkpoint"


@pytest.mark.parametrize("damage", [name for name in DAMAGES if name not in OF_THE_NETWORK])
def test_every_damage_is_detected_before_training(damage, tmp_path, first):
    """Shapes are compared with the network only when it exists; everything else is detected on loading."""
    path, chance = tmp_path / "0.safetensors", random.Random()
    for _ in range(10):
        path.write_bytes(DAMAGES[damage](first, chance))
        with pytest.raises(CheckpointError) as caught:
            load_checkpoint(path, owner())
        assert "\n" not in str(caught.value)


def test_no_flipped_bit_is_loaded(tmp_path, first):
    """The bits are at random places."""
    path, chance = tmp_path / "0.safetensors", random.Random()
    path.write_bytes(first)
    assert load_checkpoint(path, owner()).steps == ENDS[0]
    for _ in range(100):
        path.write_bytes(flipped_bit(first, chance))
        with pytest.raises(CheckpointError):
            load_checkpoint(path, owner())


OWNERS = {
    "another candidate": {"candidate": 4},
    "another rung": {"number": 1},
    "other settings": {"settings": replace(config(), seed=1)},
}


@pytest.mark.parametrize("other", [*OWNERS, "another seed", "another animal"])
def test_a_checkpoint_of_another_owner_is_refused(other, tmp_path, first):
    changes = OWNERS.get(other) or (
        {"seed": 6} if other == "another seed" else {"phenotype": replace(PHENOTYPE, fov_deg=46.0)}
    )
    (tmp_path / "0").write_bytes(first)
    with pytest.raises(CheckpointError, match=other if other in OWNERS else "another candidate"):
        load_checkpoint(tmp_path / "0", owner(**changes))


def test_workers_and_generations_may_change(tmp_path, first):
    (tmp_path / "0").write_bytes(first)
    other = replace(config(), workers=7, search=replace(config().search, generations=99))
    assert load_checkpoint(tmp_path / "0", owner(settings=other)) is not None


def test_a_file_of_a_second_damage_gets_another_name(tmp_path, first):
    for number in range(3):
        (tmp_path / "0.safetensors").write_bytes(first[:100])
        with pytest.warns(CheckpointWarning):
            rung_in(tmp_path, 1).set_aside_unusable(PHENOTYPE, config(), SEED)
        assert len(list(tmp_path.iterdir())) == number + 1


def test_a_missing_checkpoint_is_none(tmp_path):
    assert load_checkpoint(tmp_path / "nothing", owner()) is None


def test_a_checkpoint_reads_back_equal(tmp_path, first):
    (tmp_path / "0").write_bytes(first)
    loaded = load_checkpoint(tmp_path / "0", owner())
    save_checkpoint(loaded, tmp_path / "again", owner())
    assert (tmp_path / "again").read_bytes() == first


def job(folder):
    (folder / "0.safetensors").write_bytes((folder / "given").read_bytes())
    return Job(3, PHENOTYPE, config(), SEED, folder / "policy", rung_in(folder, 1))


@pytest.mark.parametrize("damage", [None, "a flipped bit"])
def test_a_checkpoint_that_is_damaged_on_its_way_to_a_dask_worker_has_no_effect(damage, tmp_path, first, undisturbed):
    (tmp_path / "given").write_bytes(first)
    order = dask_worker.encode(job(tmp_path), to_toml(config()), "no:function", "counter", "topic")
    assert order.begun == (0, first)
    steps = []
    if damage:
        order = replace(order, begun=(0, DAMAGES[damage](first, random.Random())))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", CheckpointWarning)
        reply = dask_worker._evaluate(evaluate_candidate, order, lambda *s: steps.append(s[0]))
    outcome, policy, _ = dask_worker.decode(reply)
    assert (replace(outcome, seconds=0.0), policy) == undisturbed
    assert [w.category for w in said if issubclass(w.category, CheckpointWarning)] == [CheckpointWarning] * bool(damage)
    assert (min(steps) == ENDS[0]) == bool(damage), "a sound checkpoint is used"


class Interrupting(Nobody):
    """Watcher that interrupts a run once the first rung of a generation is complete."""

    def evaluated(self, candidate):
        if candidate.rung == 0 and candidate.index == 1:
            raise KeyboardInterrupt


@pytest.mark.slow
def test_a_resumed_run_names_the_file_and_has_the_same_record(tmp_path, first):
    """All checkpoints of an interrupted run are exchanged between candidates or damaged."""
    settings = assemble("detection", "quick", assignments=[*SMALL, "search.generations=1", "search.rungs=2"])
    whole = Run.create(tmp_path / "whole", settings)
    evolve(whole, Learning(), Nobody())
    path = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        evolve(Run.create(path, settings), Learning(), Interrupting())
    kept = sorted((path / "trainings").iterdir())
    assert len(kept) == 2
    one, other = (file.read_bytes() for file in kept)
    for file, content in zip(kept, (other, one), strict=True):
        file.write_bytes(content)
    run = Run.open(path)
    with pytest.warns(CheckpointWarning, match="it belongs to another candidate; it is renamed to 00000") as said:
        evolve(run, Learning(), Nobody())
    assert len(said) == 1, "only one candidate goes on"
    assert history(Run.open(path)) == history(whole)
    assert [file.name[6:] for file in (path / "trainings").iterdir()] == ["-0.safetensors.unused"]
