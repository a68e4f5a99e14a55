"""A Dask worker compares its software with that of the sender, and evaluates a candidate from its latest checkpoint."""

import importlib.util
import sys

import pytest

from evolve.config.assemble import to_toml
from evolve.learning.training_rung import TrainingRung
from evolve.search import dask_worker
from evolve.search.dask_worker import Order, UnfitWorker
from evolve.search.job import Job
from evolve.store.evaluation import Evaluation
from evolve.store.versions import present
from tests.evolve.closed_form import tiny
from tests.evolve.small_run import PHENOTYPE

HERE = {"numpy": "2.1", "torch": "2.4", "commit": ""}


@pytest.fixture
def prepared(monkeypatch):
    """Return a list to which every preparation of the device adds an entry. The worker's software is HERE."""
    calls = []
    monkeypatch.setattr(dask_worker, "_software", lambda: HERE)
    monkeypatch.setattr(dask_worker, "_prepared", False)
    monkeypatch.setattr(dask_worker, "prepare_device", lambda: calls.append("prepared"))
    return calls


def order(**software):
    return Order("no:function", 0, "{}", "", 1, "counter", "topic", {**HERE, **software})


@pytest.mark.parametrize("software", [{}, {"torch": ""}, {"commit": "abc"}])
def test_a_worker_with_the_same_known_versions_prepares_its_device_once(prepared, software):
    for _ in range(2):
        dask_worker._prepare(order(**software))
    assert prepared == ["prepared"]


def test_a_worker_with_other_versions_names_them_and_prepares_nothing(prepared):
    with pytest.raises(UnfitWorker, match=r"other software, and numbers would differ: torch 2\.4 \(here 1\.0\)$"):
        dask_worker._prepare(order(torch="1.0"))
    assert prepared == []


@pytest.mark.parametrize("present", [(), (0,), (1,), (0, 1, 2)])
def test_the_latest_checkpoint_travels_to_the_worker_and_the_new_one_back(prepared, tmp_path, present):
    """The training has four rungs, so that the first, second and last checkpoint differ."""
    paths = tuple(tmp_path / str(number) for number in range(4))
    for number in present:
        paths[number].write_bytes(b"%d" % number)
    config, outcome = tiny(), Evaluation(2.5, (2.0, 3.0), 0.5, 40, 0.1, ((20, 0.25), (40, 2.5)))

    def train(phenotype, settings, seed, policy, rung, progress):
        assert (phenotype, to_toml(settings), seed) == (PHENOTYPE, to_toml(config), 5)
        assert (rung.ends, rung.candidate) == ((10, 20, 30, 40), 7)
        assert [(k, path.read_bytes()) for k, path in enumerate(rung.checkpoints) if path.exists()] == [
            (number, b"%d" % number) for number in present[-1:]
        ]
        rung.checkpoints[-1].write_bytes(b"new")
        policy.write_bytes(b"policy")
        return outcome

    job = Job(7, PHENOTYPE, config, 5, tmp_path / "policy", TrainingRung((10, 20, 30, 40), paths, 7))
    sent = dask_worker.encode(job, to_toml(config), "no:function", "counter", "topic")
    reply = dask_worker._evaluate(train, sent, lambda steps, planned: None)
    assert dask_worker.decode(reply) == (outcome, b"policy", b"new")


def test_a_candidate_without_rungs_has_no_checkpoint(prepared, tmp_path):
    job = Job(7, PHENOTYPE, tiny(), 5, tmp_path / "policy")
    sent = dask_worker.encode(job, to_toml(tiny()), "no:function", "counter", "topic")
    failed = Evaluation.failed("it fell")
    assert (sent.ends, sent.begun) == ((), None)
    reply = dask_worker._evaluate(lambda *_, progress: failed, sent, lambda steps, planned: None)
    assert dask_worker.decode(reply) == (failed, b"", b"")


def test_a_fresh_process_is_not_prepared(monkeypatch):
    specification = importlib.util.find_spec(dask_worker.__name__)
    fresh = importlib.util.module_from_spec(specification)
    monkeypatch.setitem(sys.modules, specification.name, fresh)  # dataclasses look their module up
    specification.loader.exec_module(fresh)
    calls = []
    fresh._software, fresh.prepare_device = lambda: HERE, lambda: calls.append("prepared")
    fresh._prepare(order())
    assert calls == ["prepared"]


def test_the_software_of_a_worker_is_that_of_its_process():
    assert dask_worker._software() == present()
