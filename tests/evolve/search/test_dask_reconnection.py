"""Reconnection to a scheduler, with clients that only have a status."""

from types import SimpleNamespace

import pytest

from evolve.search import dask_executor
from evolve.search.dask_executor import DaskExecutor


class Client:
    """A client whose status changes each time it is read."""

    def __init__(self, *statuses):
        self.statuses = list(statuses)

    @property
    def status(self):
        return self.statuses.pop(0) if len(self.statuses) > 1 else self.statuses[0]


@pytest.fixture
def reconnect(monkeypatch):
    """Return a function that reconnects a client, and returns the number of new clients."""
    monkeypatch.setattr(dask_executor.time, "sleep", lambda seconds: None)

    def run(client):
        made = []
        executor = SimpleNamespace(_client=client, patience_s=60.0, _address="tcp://here")
        executor._connected = lambda timeout: made.append(timeout) or Client("running")
        DaskExecutor._reconnect(executor)
        assert executor._client.status == "running"
        return len(made)

    return run


def test_a_client_that_is_connecting_is_left_alone(reconnect):
    """Each status is read twice: for the loop, and for the decision."""
    assert reconnect(Client("connecting", "connecting", "connecting", "connecting", "running")) == 0


def test_a_client_that_is_closed_is_replaced(reconnect):
    assert reconnect(Client("closed")) == 1
    assert reconnect(Client("connecting", "connecting", "closed")) == 1
    assert reconnect(Client("running")) == 0
