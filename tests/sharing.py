"""A pytest plugin: with `-n auto`, the tests of a file run on one worker, so that fixtures and caches are built once.

Groups of files that share expensive fixtures also run on one worker. Long files whose tests share nothing are divided
among all workers. Any other value of `--dist` than the default works as usual.
"""

from __future__ import annotations

from typing import Any

import pytest

# Names of groups, and the common start of their tests' names.
SHARING = {
    "a run, an episode and its page": ("tests/evolve/report/",),
    "a run and an episode": ("tests/evolve/episodes/test_episode.py", "tests/evolve/cli/test_products.py"),
    "the sources, parsed": (
        *("tests/test_architecture.py", "tests/test_conventions.py", "tests/rhabdom/test_dependencies.py"),
        *("tests/test_docs.py::test_paths", "tests/test_docs.py::test_names"),
    ),
}
# Files of which any worker may run any test.
DIVIDED = (
    "tests/experiments/test_records.py",
    "tests/sim/render/test_sample_choice.py",
    "tests/sim/render/test_vertical_field.py",
    "tests/test_docs.py",
)


def group(test: str) -> str:
    """Return the name of a test's group; the tests of a group run on one worker."""
    alone = test if test.startswith(DIVIDED) else test.split("::")[0]
    return next((name for name, starts in SHARING.items() if test.startswith(starts)), alone)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    from xdist.scheduler import LoadScopeScheduling

    if config.getoption("dist") != "load":
        return None

    class Groups(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return group(nodeid)

    return Groups(config, log)
