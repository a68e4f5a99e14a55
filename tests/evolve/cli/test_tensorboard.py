"""TensorBoard shows the values on record."""

import shutil
import threading
from dataclasses import replace

import pytest

from evolve.cli.tensorboard import TensorBoardWriter
from evolve.store.directory import Run


def test_numbers_are_the_records(finished, tmp_path):
    accumulator = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    run = Run.open(shutil.copytree(finished, tmp_path / "run"))
    with TensorBoardWriter(run):
        pass
    shown = {}
    for name in ("candidates", "generations"):
        events = accumulator.EventAccumulator(str(run.path / "tensorboard" / name))
        events.Reload()
        for tag in events.Tags()["scalars"]:
            steps = [event.step for event in events.Scalars(tag)]
            assert len(steps) == len(set(steps)), f"{tag} is written more than once"
        shown[name] = {tag: {e.step: e.value for e in events.Scalars(tag)} for tag in events.Tags()["scalars"]}
    assert shown["candidates"]["fitness"] == pytest.approx({c.id: c.fitness for c in run.candidates}, rel=1e-6)
    assert shown["candidates"]["genes/fov_deg"] == pytest.approx({c.id: c.phenotype.fov_deg for c in run.candidates})
    best = {g: max(c.fitness for c in run.generation(g)) for g in range(3)}
    assert shown["generations"]["fitness/best"] == pytest.approx(best, rel=1e-6)


def test_only_what_goes_on_is_open(finished, tmp_path):
    """A writer is a thread and a file, and a run may have thousands of candidates."""
    accumulator = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    run = Run.open(shutil.copytree(finished, tmp_path / "run"))
    learned = [replace(c, curve=((2048, 1.0), (4096, float(c.id)))) for c in run.candidates]
    before = threading.active_count()
    with TensorBoardWriter(run) as writer:
        for candidate in learned:
            writer.evaluated(candidate)
        assert threading.active_count() <= before + 2, "the writers of candidates and generations"
        writer.evaluated(replace(learned[0], curve=((8192, 9.0),)))  # after another rung
    events = accumulator.EventAccumulator(str(run.path / "tensorboard" / "learning" / "000000"))
    events.Reload()
    shown = sorted((event.step, event.value) for event in events.Scalars("return"))
    assert shown == [(2048, 1.0), (4096, 0.0), (8192, 9.0)]
