"""Workers within this process: their messages, the kinds of errors, and memory that they return."""

import ctypes
import errno
import multiprocessing
import sys
import threading
import warnings
from types import SimpleNamespace

import pytest

from evolve.config.run_config import ConfigError
from evolve.search import worker
from evolve.search.worker import Message, evaluated, refusal, work


@pytest.fixture
def slim(monkeypatch):
    """Omit the return of memory to the system, which takes a second."""
    monkeypatch.setattr(worker, "_give_back_memory", lambda: None)


@pytest.fixture
def messages(slim, monkeypatch):
    """Return a function that lets a worker evaluate, and returns its messages up to its end."""
    monkeypatch.setattr(worker, "send_all_to_stderr", lambda: None)

    def all_messages(evaluate, arguments, prepare=None):
        ours, theirs = multiprocessing.Pipe()
        for one in arguments:
            ours.send(one)
        found = []
        thread = threading.Thread(target=lambda: (work(theirs, evaluate, prepare), theirs.close()), daemon=True)
        thread.start()
        while len([message for message in found if message.kind != "progress"]) < max(len(arguments), 1):
            assert ours.poll(20), "the worker sends nothing"
            found.append(ours.recv())
            if found[-1].kind == "unfit":
                break
        if found[-1].kind != "unfit":
            assert thread.is_alive(), "the worker waits for further candidates"
            ours.close()
        thread.join(20)
        assert not thread.is_alive()
        return found

    return all_messages


def doubled(value, progress):
    progress(1, 3)
    return value * 2


def test_progress_and_results(messages):
    found = messages(doubled, [(1,), (4,)])
    steps = Message("progress", (1, 3))
    assert found == [steps, Message("done", 2), steps, Message("done", 8)]


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (
            OSError(errno.ENOSPC, "No space left", "p"),
            "[Errno 28] No space left: 'p'; correct this, then use evolve resume",
        ),
        (ConfigError("mine.py:\n  line 3", "task"), "mine.py: line 3"),
        (
            MemoryError("3 GiB\nfor x"),
            "out of memory (3 GiB for x); use fewer workers (workers in config.toml), or free some memory, then use "
            "evolve resume",
        ),
    ],
)
def test_errors_that_no_animal_causes(messages, error, reason):
    def fail(value, progress):
        raise error

    assert messages(fail, [(1,)]) == [Message("unfit", reason)]


def test_a_preparation_that_fails(messages):
    def fail():
        raise RuntimeError("no LLVM\n here")

    assert messages(doubled, [], fail) == [Message("unfit", "no LLVM here")]


def test_a_preparation_comes_first(messages):
    prepared = []
    assert (
        messages(lambda value, progress: len(prepared), [(1,), (1,)], lambda: prepared.append(1))
        == [Message("done", 1)] * 2
    )


def raising(error):
    def evaluate(value, progress):
        raise error

    return evaluate


@pytest.mark.parametrize("error", [ValueError("no\nluck"), SystemExit(5), GeneratorExit(), RuntimeError("x")])
@pytest.mark.usefixtures("slim")
def test_other_errors_fail_the_candidate(error):
    found = evaluated(raising(error), (1,), print)
    said = " ".join(f"{type(error).__name__}: {error}".split())
    assert found.failure.startswith(f"{said} (test_worker.py:")
    assert found.seconds > 0


@pytest.mark.parametrize("words", worker.NO_MEMORY)
@pytest.mark.usefixtures("slim")
def test_memory_that_other_libraries_lack(words):
    with pytest.raises(MemoryError, match=f"RuntimeError: a {words} b"):
        evaluated(raising(RuntimeError(f"a {words} b")), (1,), print)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError("x"), MemoryError(), ConfigError("x", "task")])
def test_errors_that_are_passed_on(error, monkeypatch):
    given_back = []
    monkeypatch.setattr(worker, "_give_back_memory", lambda: given_back.append(1))
    with pytest.raises(type(error)) as caught:
        evaluated(raising(error), (1,), print)
    assert caught.value is error
    assert given_back == [1], "memory is also returned after an error"


def test_a_long_reason_for_missing_memory_is_cut_off():
    assert refusal(MemoryError("x" * 300)).count("x") == 200


@pytest.mark.parametrize("child", [False, True])
def test_caches_of_kernels_are_freed_in_workers_only(monkeypatch, child):
    calls = []
    drjit = SimpleNamespace(
        flush_kernel_cache=lambda: calls.append("kernels"), flush_malloc_cache=lambda: calls.append("memory")
    )
    library = SimpleNamespace(malloc_trim=lambda pad: calls.append(pad))
    monkeypatch.setattr(worker.gc, "collect", lambda: calls.append("garbage"))
    monkeypatch.setitem(sys.modules, "drjit", drjit)
    monkeypatch.setattr(worker.multiprocessing, "parent_process", lambda: object() if child else None)
    monkeypatch.setattr(ctypes, "CDLL", lambda name: library)
    worker._give_back_memory()
    assert calls == ["garbage", *(["kernels", "memory"] if child else []), 0]


def test_glibc_keeps_freed_memory(monkeypatch):
    """The numbers of the settings are those of malloc.h: M_TRIM_THRESHOLD is -1, M_MMAP_THRESHOLD -3."""
    calls = []
    monkeypatch.setattr(ctypes, "CDLL", lambda name: SimpleNamespace(mallopt=lambda *given: calls.append(given)))
    monkeypatch.setattr(sys, "platform", "linux")
    worker._keep_freed_memory()
    assert calls == [(-3, 32 * 2**20), (-1, 2**30)]
    monkeypatch.setattr(sys, "platform", "darwin")
    worker._keep_freed_memory()
    assert len(calls) == 2
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(ctypes, "CDLL", lambda name: SimpleNamespace())
    worker._keep_freed_memory()


def test_the_wait_for_the_end_of_the_parent_does_not_keep_a_worker_alive(messages, monkeypatch):
    waiting = []
    monkeypatch.setattr(worker, "_die_with_parent", lambda: waiting.append(threading.current_thread().daemon))
    messages(doubled, [(1,)])
    assert waiting == [True]


def test_a_worker_ends_with_its_parent(monkeypatch):
    """The main process of an application has no parent process to wait for."""
    events = []
    monkeypatch.setattr(worker, "wait", lambda sentinels: events.append(sentinels))
    monkeypatch.setattr(worker.os, "_exit", events.append)
    worker._die_with_parent()
    assert events == []
    monkeypatch.setattr(worker.multiprocessing, "parent_process", lambda: SimpleNamespace(sentinel=7))
    worker._die_with_parent()
    assert events == [[7], 1]


def test_streams_are_redirected_at_the_start_and_before_each_candidate(messages, monkeypatch):
    """A task may close or replace the streams."""
    events = []
    monkeypatch.setattr(worker, "send_all_to_stderr", lambda: events.append("streams"))
    messages(lambda value, progress: events.append(value), [(1,), (2,)], lambda: events.append("prepared"))
    assert events == ["streams", "prepared", "streams", 1, "streams", 2]


def test_a_device_is_prepared_for_one_of_several_workers(monkeypatch):
    from optics.numerics import device
    from sim.envs import threads

    events = []
    monkeypatch.setattr(device, "make_ready", lambda: events.append("device"))
    monkeypatch.setattr(threads, "set_threads", lambda count: events.append(count))
    monkeypatch.setattr(worker, "_keep_freed_memory", lambda: events.append("memory"))
    worker.prepare_device()
    assert events == ["device", 1, "memory"]


def test_a_candidate_is_evaluated_without_the_warning_of_its_run(monkeypatch):
    from evolve.learning import fitness
    from sim.scene.mirror import MirrorWarning

    def evaluate(*arguments):
        warnings.warn("a material", MirrorWarning, stacklevel=1)
        warnings.warn("something else", UserWarning, stacklevel=1)
        return arguments

    monkeypatch.setattr(fitness, "evaluate", evaluate)
    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")
        found = worker.evaluate_candidate("animal", "config", 5, "path", "rung", progress=print)
    assert found == ("animal", "config", 5, "path", print, "rung")
    assert [str(warning.message) for warning in shown] == ["something else"]


def test_an_error_is_named_with_its_last_line(monkeypatch):
    """An error in a task has its place there, even if its type would otherwise end the run."""
    monkeypatch.setattr(worker, "_give_back_memory", lambda: None)

    def inner():
        raise ValueError("no")

    line = inner.__code__.co_firstlineno + 1
    found = evaluated(lambda value, progress: inner(), (1,), print)
    assert found.failure == f"ValueError: no (test_worker.py:{line})"
    monkeypatch.setattr(worker, "error_in_task", lambda error: "task.py, line 3")
    for error in (OSError("x"), ValueError("x")):
        found = evaluated(raising(error), (1,), print)
        assert found.failure == "task.py, line 3"
        assert 0 <= found.seconds < 10


@pytest.mark.parametrize("name", ["posix", "nt"])
def test_memory_is_trimmed_where_the_library_can(monkeypatch, name):
    calls = []
    monkeypatch.setattr(worker.gc, "collect", lambda: None)
    monkeypatch.setitem(sys.modules, "drjit", None)
    monkeypatch.setattr(worker, "os", SimpleNamespace(name=name))
    monkeypatch.setattr(ctypes, "CDLL", lambda library: SimpleNamespace(malloc_trim=calls.append))
    worker._give_back_memory()
    assert calls == ([0] if name == "posix" else [])
    monkeypatch.setattr(ctypes, "CDLL", lambda library: SimpleNamespace())
    worker._give_back_memory()
