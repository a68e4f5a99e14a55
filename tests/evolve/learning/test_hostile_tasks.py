"""User tasks that print, close streams, end the program or return nonsense: their candidate fails, and runs continue.

HOSTILE_TASKS=20 python -m pytest tests/evolve/learning/test_hostile_tasks.py     draws twenty times as many tasks
"""

import json
import os
import random
import re
import subprocess
import sys
from pathlib import Path

import pytest

from evolve.config.run_config import ConfigError
from evolve.config.task_errors import error_in_task
from evolve.learning.task_module import executed_task
from evolve.learning.task_trial import try_task
from evolve.search.successive_halving import finished
from evolve.search.worker import evaluate_candidate, evaluated
from evolve.store.directory import Run
from optics.numerics import backend
from tests.evolve.learning.test_task_module import BALL, BATCH, SMALL, small

ROOT = Path(__file__).parents[3]
ROUNDS = int(os.environ.get("HOSTILE_TASKS", "1"))
RAISED = {  # statement: end of the message
    "import sys; sys.exit(5)": "SystemExit: 5",
    "raise SystemExit": "SystemExit:",
    "raise GeneratorExit('gone')": "GeneratorExit: gone",
    "raise BaseException('odd')": "BaseException: odd",
    "raise OSError(28, 'No space left on device')": "OSError: [Errno 28] No space left on device",
    "open('/nowhere/file')": "FileNotFoundError: [Errno 2] No such file or directory: '/nowhere/file'",
    "raise BrokenPipeError('pipe')": "BrokenPipeError: pipe",
    "import asyncio; raise asyncio.CancelledError": "CancelledError:",
    "{}['ball']": "KeyError: 'ball'",
}
NONSENSE = {  # method: returned values that are refused
    "rewards": ['{"near": "far"}', '{"near": b"1"}', '{"near": 10**400}', '{"near": None}', '{"near": 1j}', '"near"'],
    "terminated": ['"no"', 'b""', "np.zeros(2)"],
    "succeeded": ['"False"', "np.ones(3)"],
    "proprioception": ['"here"', "1j", '["a"]', "[[1.0], [2.0, 3.0]]", "None"],
}
PRINTING = ["print('noise')", "import os; os.write(1, b'noise\\n')", "import os; os.system('echo noise')"]
CLOSING = [
    "import sys; sys.stdout and sys.stdout.close()",
    "import sys; sys.stdout = None",
    "import sys; sys.__stdout__.close()",
    "import os; os.closerange(1, 2)",
]
BASE = """
import multiprocessing
import numpy as np
import sys
sys.path.insert(0, {folder!r})
from {module} import {parent}
{at_import}

class Mine({parent}):
"""
METHOD = """
    def {name}(self, *arguments):
        if {when}:
            {statement}
        return super().{name}(*arguments)
"""


@pytest.fixture(scope="module", autouse=True)
def _device():
    backend.require()


def written(folder, methods=(), at_import="", batch=False, when="True"):
    """Write a task that executes statements in its methods before the usual code; return its name."""
    parent = BALL
    if batch:
        parent = folder / "balls.py"
        parent.write_text(BATCH.format(model=executed_task(small()[0].choice.named_code).model))
    named = {"folder": str(parent.parent), "module": parent.stem, "parent": "FindBalls" if batch else "FindBall"}
    text = BASE.format(**named, at_import=at_import)
    text += (
        "".join(METHOD.format(name=name, statement=statement, when=when) for name, statement in methods) or "    pass"
    )
    (folder / "mine.py").write_text(text)
    return f"{folder / 'mine.py'}:Mine"


def said_at_start(named):
    with pytest.raises(ConfigError) as refused:
        try_task(small(named=named)[0])
    assert "\n" not in str(refused.value)
    return str(refused.value)


@pytest.mark.parametrize("batch", [False, True], ids=["Task", "BatchTask"])
def test_whatever_a_method_raises_is_reported_with_method_line_and_file(tmp_path, batch):
    rng = random.Random()
    for _ in range(2 * ROUNDS):
        statement, words = rng.choice(sorted(RAISED.items()))
        method = rng.choice(["reset", "act", "rewards", "terminated", "proprioception"])
        said = said_at_start(written(tmp_path, [(method, statement)], batch=batch))
        assert re.search(rf"{method}, line \d+ of mine\.py: {re.escape(words)}", said), (statement, said)


@pytest.mark.parametrize("batch", [False, True], ids=["Task", "BatchTask"])
def test_whatever_a_method_raises_fails_the_candidate(tmp_path, batch):
    """The method fails only in the evaluation, as it might in a worker process."""
    rng = random.Random()
    statement, words = rng.choice(sorted(RAISED.items()))
    config, animal = small(named=written(tmp_path, [("act", statement)], batch=batch))
    outcome = evaluated(evaluate_candidate, (animal, config, 3, tmp_path / "policy"), lambda *steps: None)
    said = outcome.failure if batch else outcome.episode_failures[0][0]
    assert re.search(rf"^act, line \d+ of mine\.py: {re.escape(words)}", said), (statement, outcome)


def test_whatever_is_raised_at_import_is_reported(tmp_path):
    for statement, words in RAISED.items():
        said = said_at_start(written(tmp_path, at_import=statement))
        assert re.search(rf"mine\.py: line \d+: {re.escape(words)}", said), (statement, said)


def test_nonsense_is_reported_with_the_name_of_the_method(tmp_path):
    rng = random.Random()
    for method, values in NONSENSE.items():
        value = rng.choice(values)
        said = said_at_start(written(tmp_path, [(method, f"return {value}")]))
        assert re.search(rf"Mine: {method}(:| returned) .*: must be ", said), (value, said)


def test_text_and_complex_numbers_of_a_batch_are_refused(tmp_path):
    rng = random.Random()
    for method in ("rewards", "terminated", "proprioception"):
        array = rng.choice(["np.full(2, '1.5')", "np.full(2, 1j)", "['a', 'b']"])
        value = f"{{'near': {array}}}" if method == "rewards" else array
        said = said_at_start(written(tmp_path, [(method, f"return {value}")], batch=True))
        assert re.search(rf"Mine: {method}(:.*)? returned .*: must be an array of numbers", said), (value, said)


def test_errors_outside_of_tasks_have_no_place():
    with pytest.raises(SystemExit) as ended:
        sys.exit(3)
    assert error_in_task(ended.value) is None


def run(folder, named, *options):
    settings = [*SMALL, "search.population=2", "search.generations=1", "workers=1", "learning.total_steps=128"]
    assignments = [part for text in settings for part in ("--set", text)]
    command = ["-m", "evolve", "run", named, "--preset", "quick", *assignments, "--out", folder / "run", *options]
    return subprocess.run(
        [sys.executable, *command], cwd=ROOT, capture_output=True, check=False, timeout=500, stdin=subprocess.DEVNULL
    )


@pytest.mark.slow  # each run writes a report and EXR files; tests/rhabdom/test_streams.py has a faster case
@pytest.mark.parametrize("_", range(ROUNDS))
def test_a_run_of_a_task_that_prints_and_closes_stdout_ends_well(tmp_path, _):
    """stdout contains valid JSON only; stderr contains what the task printed, in this process and in the workers."""
    rng = random.Random()
    pair = rng.randrange(len(CLOSING))
    methods = [(rng.choice(["reset", "rewards"]), PRINTING[pair % len(PRINTING)]), ("succeeded", CLOSING[pair])]
    child = run(tmp_path, written(tmp_path, methods, at_import=rng.choice([*PRINTING, *CLOSING])), "--json")
    assert child.returncode == 0, (methods, child)
    events = [json.loads(line) for line in child.stdout.splitlines()]
    assert [event["event"] for event in events].count("evaluated") == 2
    assert finished(Run.open(tmp_path / "run"))


@pytest.mark.slow
def test_a_run_continues_if_a_task_fails_in_the_workers_only(tmp_path):
    named = written(tmp_path, [("proprioception", "sys.exit(5)")], when="multiprocessing.parent_process()", batch=True)
    child = run(tmp_path, named)
    assert child.returncode == 1, child
    failures = [candidate.failure for candidate in Run.open(tmp_path / "run").candidates]
    assert len(failures) == 2
    assert all(re.match(r"proprioception, line \d+ of mine.py: ", failure) for failure in failures), failures
