"""A pytest plugin that reports the CPU time of every test.

    ./with-env pytest -n auto --cpu-times cpu.csv
    ./with-env python -m tests.cpu_times cpu.csv                # seconds of each file, most expensive first
    ./with-env python -m tests.cpu_times cpu.csv --by test
    ./with-env python -m tests.cpu_times cpu.csv --over 1.2     # tests that took longer, for tests/slow_tests.txt

The time of a test includes its fixtures, all threads, and child processes that have ended. A shared fixture counts
for the first test that needs it. The row `<start>` holds the imports and the collection of all workers. CPU time,
unlike wall-clock time, hardly depends on what else runs on the machine.
"""

from __future__ import annotations

import argparse
import csv
import resource
from collections import defaultdict
from pathlib import Path

import pytest

START = "<start>"


def cpu_seconds() -> float:
    """CPU time of this process and of its children that have ended [s]."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


class Stopwatch:
    """Plugin of the processes that run tests. It adds the CPU time to the report of each phase of a test."""

    def __init__(self) -> None:
        self.read = 0.0
        self.start: float | None = None

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_logstart(self) -> None:
        self.read = cpu_seconds()
        if self.start is None:
            self.start = self.read

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self):
        report = yield
        now = cpu_seconds()
        report.cpu_seconds, self.read = now - self.read, now
        report.cpu_seconds_before_tests, self.start = self.start, 0.0
        return report


class Recorder:
    """Plugin of the process that the user started. It collects the reports of all workers, and writes the file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.seconds: defaultdict[str, float] = defaultdict(float)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.seconds[report.nodeid] += getattr(report, "cpu_seconds", 0.0)
        self.seconds[START] += getattr(report, "cpu_seconds_before_tests", 0.0)

    def pytest_sessionfinish(self) -> None:
        with self.path.open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(("test", "cpu_seconds"))
            rows.writerows((name, f"{seconds:.3f}") for name, seconds in self.seconds.items())

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        total = sum(self.seconds.values())
        terminalreporter.write_line(f"{total / 60:.1f} CPU minutes; {self.path} has the seconds of each test")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--cpu-times", metavar="FILE", type=Path, help="write the CPU seconds of each test to FILE, a CSV file"
    )


def pytest_configure(config: pytest.Config) -> None:
    if path := config.getoption("--cpu-times"):
        config.pluginmanager.register(Stopwatch())
        if not hasattr(config, "workerinput"):
            config.pluginmanager.register(Recorder(path))


def part(test: str, by: str) -> str:
    """The row to which a test's time is added: its folder, its file, its function or the test itself."""
    file = test.split("::")[0]
    return {
        "folder": "/".join(file.split("/")[:2]),
        "file": file,
        "function": test.split("[")[0],
        "test": test,
    }[by]


def main() -> None:
    """Print CPU seconds, most expensive first."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("file", type=Path, help="written by pytest --cpu-times")
    parser.add_argument("--by", choices=("folder", "file", "function", "test"), default="file")
    parser.add_argument("--rows", type=int, default=40, help="rows to print")
    parser.add_argument(
        "--over", type=float, metavar="SECONDS", help="print the names of tests that took longer, alone"
    )
    arguments = parser.parse_args()
    sums: defaultdict[str, float] = defaultdict(float)
    with arguments.file.open(newline="") as file:
        for row in csv.DictReader(file):
            sums[part(row["test"], "test" if arguments.over else arguments.by)] += float(row["cpu_seconds"])
    if arguments.over is not None:
        print("\n".join(sorted(name for name, seconds in sums.items() if seconds > arguments.over and name != START)))
        return
    print(f"{sum(sums.values()):9.1f}  all")
    for name, seconds in sorted(sums.items(), key=lambda entry: -entry[1])[: arguments.rows]:
        print(f"{seconds:9.1f}  {name}")


if __name__ == "__main__":
    main()
