"""Pytest plugin for `validation.mutants`: fast tests run first, slow ones are omitted, and failures are recorded.

The environment variable MUTANTS names a JSON file: {"times": {test: seconds} or null, "measured": [tests], "seconds":
budget, "report": file}.
If the times are null, all tests that have not been measured yet run until the budget is spent. The report contains the
duration of each test and the failed tests.
"""

from __future__ import annotations

import json
import os
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest

FEWEST = 2  # tests of a file that always run, even if slow


class Nearest:
    """Instructions for one run of pytest, and its results."""

    def __init__(self, asked: dict[str, Any]) -> None:
        self.known: dict[str, float] | None = asked["times"]
        self.measured = set(asked["measured"])
        self.budget: float = asked["seconds"]
        self.report = Path(asked["report"])
        self.took: dict[str, float] = defaultdict(float)
        self.failed: list[str] = []
        self.began = time.monotonic()

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        if self.known is None:
            items[:] = [item for item in items if item.nodeid not in self.measured]
            return
        files: dict[str, list[pytest.Item]] = defaultdict(list)
        for item in items:
            if item.nodeid in self.known:
                files[item.nodeid.split("::")[0]].append(item)
        kept = [item for of_file in sorted(files.values(), key=self._dear) for item in self._quick(of_file)]
        config.hook.pytest_deselected(items=[item for item in items if item not in kept])
        items[:] = kept

    def _dear(self, items: list[pytest.Item]) -> float:
        return sum(self.known[item.nodeid] for item in items)

    def _quick(self, items: list[pytest.Item]) -> list[pytest.Item]:
        """Return the fastest tests of a file that fit into the budget."""
        kept: list[pytest.Item] = []
        spent = 0.0
        for item in sorted(items, key=lambda item: self.known[item.nodeid]):
            spent += self.known[item.nodeid]
            if spent <= self.budget or len(kept) < FEWEST:
                kept.append(item)
        return kept

    def pytest_runtest_logfinish(self) -> None:
        if self.known is None and time.monotonic() - self.began > self.budget:
            self.session.shouldstop = "the tests of this file are slow"

    def pytest_sessionstart(self, session: pytest.Session) -> None:
        self.session = session

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.took[report.nodeid] += report.duration
        if report.failed and report.nodeid not in self.failed:
            self.failed.append(report.nodeid)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self.failed.append(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        self.report.write_text(json.dumps({"took": self.took, "failed": self.failed}))


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(Nearest(json.loads(Path(os.environ["MUTANTS"]).read_text())))
