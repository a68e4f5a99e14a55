"""A pytest plugin: with `-n auto`, tests that share expensive fixtures run on one worker, and others on any.

This is the behaviour of pytest-xdist's option `--dist loadgroup` and its mark `xdist_group`, which have no effect with
pytest 9.2. Any other value of `--dist` works as usual.
"""

from __future__ import annotations

from typing import Any

import pytest

# Names of groups, and the common start of their tests' names.
SHARING = {
    "contrasts of the standard observer": ("tests/optics/elements/test_human_eye.py::test_standard_observer",),
    "a run, an episode and its page": ("tests/evolve/report/",),
    "a run and an episode": ("tests/evolve/analysis/test_episode.py", "tests/evolve/cli/test_products.py"),
    "a run in a user task": ("tests/evolve/analysis/test_recorder.py",),
    "five stages of an eye": ("tests/experiments/test_five_eyes.py",),
    "lives behind lenses": ("tests/experiments/test_sharp_lenses.py",),
    "a wheel": ("tests/rhabdom/test_wheel.py",),
    "a Dask cluster": ("tests/evolve/search/test_dask_executor.py",),
    "a silent Dask cluster": ("tests/evolve/search/test_silent_cluster.py",),
    "animals that evolve in turn": ("tests/evolve/learning/test_animals_in_turn.py",),
    "tables and figures of a run": ("tests/evolve/interactive/test_opened_run.py",),
    "outputs before a change": ("tests/test_parameters.py",),
    "the sources, parsed": (
        *("tests/test_architecture.py", "tests/test_conventions.py", "tests/rhabdom/test_dependencies.py"),
        *("tests/test_docs.py::test_paths", "tests/test_docs.py::test_names"),
    ),
    "the prose of all files": ("tests/test_plain_english.py",),
    "the built site": tuple(f"tests/test_docs.py::test_{name}" for name in ("site", "menus", "reference")),
}


def group(test: str) -> str:
    """Name of the group of a test; tests of one group run on one worker."""
    return next((name for name, starts in SHARING.items() if test.startswith(starts)), test)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    from xdist.scheduler import LoadScopeScheduling

    if config.getoption("dist") != "load":
        return None

    class Groups(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return group(nodeid)

    return Groups(config, log)
