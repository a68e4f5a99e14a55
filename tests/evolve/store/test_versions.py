"""The versions behind a run are recorded, and settings that change later are detected."""

import json
import os

from evolve.store.versions import config_change, machine, machines, present, record_start, recorded


def test_versions_are_recorded_at_each_start(run):
    assert recorded(run.path) == present()
    assert {"nevergrad", "cma", "torch", "drjit", "python"} <= present().keys()
    record_start(run.path, 7)
    starts = json.loads((run.path / "versions.json").read_text())
    assert [start["candidates"] for start in starts] == [0, 7]


def test_machines_are_recorded_at_each_start(run):
    assert machine().endswith(f", {os.cpu_count()} cores")
    assert machines(run.path) == [machine()]
    starts = json.loads((run.path / "versions.json").read_text())
    (run.path / "versions.json").write_text(json.dumps([{**starts[0], "processor": "another"}, *starts]))
    assert machines(run.path) == ["another", machine()]


def test_settings_that_change_meanwhile_are_noticed(run):
    """Settings that leave existing results unchanged may change: the number of workers, and the number of
    generations.
    """
    config = run.path / "config.toml"
    began = config.read_text()
    changes = (
        ("workers = ", "workers = 1", ", but only in comments, workers or generations"),
        ("generations = ", "generations = 1", ", but only in comments, workers or generations"),
        ("[eye]", "# what eyes have in common\n\n[eye]", ", but only in comments, workers or generations"),
        ("noise_sigma = ", "noise_sigma = 1", ". Candidates from 3 on are trained and evaluated with other settings"),
    )
    for setting, other, noticed in changes:
        changed = began.replace(setting, other)
        assert changed != began
        config.write_text(changed)
        assert config_change(run.path, 3).startswith(f"config.toml has changed since the last start{noticed}")
    record_start(run.path, 3)
    assert config_change(run.path, 3) is None, "the change was already reported"
    (run.path / "versions.json").unlink()
    assert config_change(run.path, 3) is None
