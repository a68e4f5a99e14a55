"""A pytest plugin that leaves slow tests out, unless `--all` is given.

Slow are

- tests with the mark `slow`;
- tests that `tests/slow_tests.txt` lists: all took more than 1.2 s of CPU time (`python -m tests.cpu_times cpu.csv
  --over 1.2`). Some that take longer are not listed, because no faster test does their work;
- of a test with the mark `fast_cases(n)`, all cases but n, chosen so that they cover the values of the parameters: of 3
  shapes and 4 methods, `fast_cases(4)` runs each shape and each method at least once;
- random examples (hypothesis) beyond the first few, in tests with `@sweep(count)`.

    ./with-env pytest -n auto          # the fast part
    ./with-env pytest -n auto --all    # everything
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

LISTED = Path(__file__).with_name("slow_tests.txt")
FAST_EXAMPLES = 5
FAST, ALL = "fast", "all"  # profiles of hypothesis
settings.register_profile(FAST)
settings.register_profile(ALL)


def sweep(count: int, fast: int = FAST_EXAMPLES) -> settings:
    """Return the settings of a test with random examples, which are the same in every run.

    The test has `count` examples with `--all`, and otherwise the first `fast` of them.
    """
    return settings(
        max_examples=count if settings.get_current_profile_name() == ALL else min(count, fast),
        deadline=None,
        derandomize=True,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much, HealthCheck.data_too_large],
    )


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--all", action="store_true", help="run the slow tests too")


def pytest_configure(config: pytest.Config) -> None:
    everything = config.getoption("--all")
    settings.load_profile(ALL if everything else FAST)
    if everything:
        config.option.markexpr = ""


def slow(*values: object) -> Any:
    """Return a case for `pytest.mark.parametrize` that is slow."""
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.hookimpl(tryfirst=True)  # before pytest drops the marked tests
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    cases: defaultdict[str, list[Any]] = defaultdict(list)
    listed = set(LISTED.read_text().splitlines())
    for item in items:
        if item.nodeid in listed:
            item.add_marker(pytest.mark.slow)
        if item.get_closest_marker("fast_cases"):
            cases[item.nodeid.split("[")[0]].append(item)
    for same_test in cases.values():
        (count,) = same_test[0].get_closest_marker("fast_cases").args
        values = [{name: id(value) for name, value in item.callspec.params.items()} for item in same_test]
        fast = fast_cases(values, count)
        for number, item in enumerate(same_test):
            if number not in fast:
                item.add_marker(pytest.mark.slow)


def fast_cases(cases: list[dict[str, int]], count: int) -> list[int]:
    """Return the indices of `count` cases that cover as many values of the parameters as possible.

    They are chosen one after another. Each time, it is the first case with the most values that are not covered yet.

    cases: for each parameter, a number that equal values share
    """
    chosen: list[int] = []
    seen: set[tuple[str, int]] = set()
    while len(chosen) < min(count, len(cases)):
        left = [place for place in range(len(cases)) if place not in chosen]
        best = max(left, key=lambda place: len(cases[place].items() - seen))
        chosen.append(best)
        seen |= cases[best].items()
    return chosen
