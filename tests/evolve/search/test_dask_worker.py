"""A Dask worker compares its software with that of the sender before it evaluates a candidate."""

import pytest

from evolve.search import dask_worker
from evolve.search.dask_worker import Order, UnfitWorker

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
