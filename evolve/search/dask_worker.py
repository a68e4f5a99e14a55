"""Evaluation of a candidate in a Dask worker. Jobs and results are sent as text and bytes.

A worker and the sender of its jobs share no files and no state; they only connect to the same scheduler. A worker
process evaluates one candidate at a time, even if Dask gives it several threads, and computes in a single thread. A
worker of the local executor does the same, so both compute floating-point sums in the same order.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from evolve.config.assemble import from_text
from evolve.config.checks import ConfigError
from evolve.config.task_code import TaskCode
from evolve.genome.phenotype import Phenotype
from evolve.learning.training_rung import TrainingRung
from evolve.search.job import ATTEMPTS, Job
from evolve.search.worker import evaluated, prepare_device, refusal
from evolve.store.evaluation import Evaluation
from evolve.store.regular_files import read
from evolve.store.versions import present

__all__ = ["Order", "UnfitWorker", "decode", "encode", "evaluate"]

COUNTER_S = 20.0  # [s] time limit for the scheduler to send a counter of attempts
Reply = tuple[str, bytes, bytes]  # Evaluation as JSON, content of the policy and of the checkpoint
_one_at_a_time = threading.Lock()
_prepared = False


class UnfitWorker(RuntimeError):
    """A worker cannot evaluate candidates, or its software differs from that of the process that sends the jobs.

    With different software, its results could differ from those of other workers. The message states the reason in one
    line.
    """


class _Unwanted(Exception):
    """The sender of a job has disconnected, or has cancelled the job."""


@dataclass(frozen=True)
class Order:
    """A job in a form that can be sent to a worker.

    function: "module:name" of the function that evaluates the candidate
    id, seed: id of the candidate, and seed of its training and evaluation
    phenotype: the phenotype as JSON
    config: the settings of the run as TOML
    counter: name of the scheduler's variable that counts the attempts to evaluate this candidate
    topic: Dask topic on which the worker reports its progress
    ends: total number of training steps at the end of each rung, up to the last rung of this job. A rung is a part of
        a training run. () if training is not divided into rungs
    begun: number of the last complete rung, and content of its checkpoint file, from which training continues. None:
        training starts from the beginning
    software: versions of the software on the machine that sends the job
    code: path and text of a user task's file; None for a built-in task
    """

    function: str
    id: int
    phenotype: str
    config: str
    seed: int
    counter: str
    topic: str
    software: Mapping[str, str]
    ends: tuple[int, ...] = ()
    begun: tuple[int, bytes] | None = None
    code: tuple[str, str] | None = None


def encode(job: Job, toml: str, function: str, counter: str, topic: str) -> Order:
    """Return a job in a form that can be sent to a worker.

    toml: settings of the run
    function, counter, topic: see `Order`

    Raises:
        OSError: a checkpoint cannot be read.
        ConfigError: the run has a user task that the user has not named on the command line or in a Python call.
    """
    phenotype = json.dumps(job.phenotype.to_json())
    task = job.config.choice.named_code
    code = None if task is None else (str(task.file), task.text)
    order = Order(function, job.id, phenotype, toml, job.seed, counter, topic, _software(), code=code)
    if job.rung is None:
        return order
    kept = [(number, read(path)) for number, path in enumerate(job.rung.checkpoints[:-1]) if path.exists()]
    return replace(order, ends=job.rung.ends, begun=kept[-1] if kept else None)


def evaluate(order: Order) -> Reply:
    """Evaluate a candidate in a Dask worker. Return its Evaluation as JSON, and the bytes of its policy and checkpoint.

    The bytes are empty if the candidate has no policy or checkpoint.

    Raises:
        UnfitWorker: the worker cannot evaluate candidates, or its software differs from that of the process that sent
            the order.
        TimeoutError: the scheduler takes too long to send the number of earlier attempts to evaluate this candidate.
    """
    from distributed import Variable, get_worker

    worker = get_worker()
    attempts = Variable(order.counter, client=worker._get_client())
    begun = int(attempts.get(timeout=COUNTER_S)) + 1
    if begun > ATTEMPTS:
        return _text(Evaluation.failed(f"its worker process died {ATTEMPTS} times")), b"", b""
    attempts.set(begun)
    key = worker.get_current_task()

    def progress(steps: int, planned: int) -> None:
        task = worker.state.tasks.get(key)
        if task is None or task.state in ("cancelled", "released", "forgotten"):
            raise _Unwanted
        worker.log_event(order.topic, [order.id, steps, planned])

    with _one_at_a_time:
        _prepare(order)
        module, name = order.function.split(":")
        try:
            return _evaluate(getattr(import_module(module), name), order, progress)
        except (OSError, MemoryError) as error:
            raise UnfitWorker(f"error on a worker's machine: {refusal(error)}, then use evolve resume") from error
        except ConfigError as error:
            raise UnfitWorker(" ".join(str(error).split())) from error


def decode(reply: Reply) -> tuple[Evaluation, bytes, bytes]:
    """Return the contents of a reply of `evaluate`: Evaluation, bytes of the policy, bytes of the checkpoint."""
    text, policy, checkpoint = reply
    record = json.loads(text)
    record["returns"] = tuple(record["returns"])
    record["curve"] = tuple((int(steps), float(value)) for steps, value in record["curve"])
    failures = record["episode_failures"]
    record["episode_failures"] = tuple((said, int(episodes)) for said, episodes in failures)
    return Evaluation(**record), policy, checkpoint


def _evaluate(function: Callable[..., Evaluation], order: Order, progress: Callable[[int, int], None]) -> Reply:
    config = from_text(order.config)
    if order.code is not None:
        file, text = order.code
        config = replace(config, code=TaskCode(config.task_name, Path(file), text))
    phenotype = Phenotype.from_json(json.loads(order.phenotype))
    with TemporaryDirectory() as folder:
        policy = Path(folder) / f"{order.id:06d}"
        checkpoints = tuple(policy.with_name(f"{policy.name}-{number}") for number in range(len(order.ends)))
        if order.begun is not None:
            number, content = order.begun
            checkpoints[number].write_bytes(content)
        rung = (TrainingRung(order.ends, checkpoints, order.id),) if checkpoints else ()
        outcome = evaluated(function, (phenotype, config, order.seed, policy, *rung), progress)
        return _text(outcome), _content(policy), _content(checkpoints[-1]) if checkpoints else b""


def _content(path: Path) -> bytes:
    return path.read_bytes() if path.exists() else b""


def _prepare(order: Order) -> None:
    """Compare this worker's software versions with those of the process that sent the order, and prepare Dr.Jit.

    Dr.Jit is prepared only at the first call in this process. A version that is unknown on one side is not compared.
    For example, the commit is unknown if the code is not in a git repository.

    Raises:
        UnfitWorker: a version differs, or Dr.Jit cannot be prepared.
    """
    global _prepared
    here = _software()
    differing = [name for name, there in order.software.items() if there and here[name] and here[name] != there]
    if differing:
        names = ", ".join(f"{name} {here[name]} (here {order.software[name]})" for name in differing)
        raise UnfitWorker(f"a worker has other software, and numbers would differ: {names}")
    if not _prepared:
        try:
            prepare_device()
        except Exception as error:
            raise UnfitWorker(" ".join(str(error).split())) from error
        _prepared = True


@lru_cache
def _software() -> Mapping[str, str]:
    """Return the versions of the software; see `present`. They are cached, because git takes milliseconds."""
    return present()


def _text(outcome: Evaluation) -> str:
    record: dict[str, Any] = asdict(outcome)
    return json.dumps(record)
