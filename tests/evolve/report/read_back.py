"""Recordings for rerun, read with rerun's own reader."""

import numpy as np
import pytest

from evolve.report.rerun_recording import write_recording


def read_back(episode, folder):
    """Return the values of each entity and component in order of the actions; for static components, their single
    value.
    """
    pytest.importorskip("rerun", reason="the extra rerun is not installed")
    from rerun.chunk import RrdReader

    path = write_recording(episode, folder / "episode.rrd")
    assert [file.name for file in folder.iterdir()] == ["episode.rrd"], "a partial file remains"
    rows = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        actions = [0] * chunk.num_rows if chunk.is_static else batch.column("action").to_pylist()
        for name in batch.schema.names:
            if ":" in name or name == "time":
                found = rows.setdefault((chunk.entity_path, name), [])
                found += zip(actions, batch.column(name).to_pylist(), strict=True)
    for (_, component), values in rows.items():
        if component == "Transform3D:translation" and len(values) > 1:
            assert sorted(action for action, _ in values) == list(range(len(episode))), "each value has its own time"
    return {key: [value for _, value in sorted(values, key=lambda row: row[0])] for key, values in rows.items()}


def vectors(columns, entity, component):
    return np.array([value[0] for value in columns[entity, component]])


def frames(columns, entity):
    """Return rotations from components stored by columns."""
    return vectors(columns, entity, "Transform3D:mat3x3").reshape(-1, 3, 3).swapaxes(1, 2)


def views(episode, folder):
    """Return the views of a recording: the entities in each view, by kind."""
    pytest.importorskip("rerun", reason="the extra rerun is not installed")
    from rerun.chunk import RrdReader

    reader = RrdReader(write_recording(episode, folder / "laid_out.rrd"))
    (blueprint,) = reader.blueprints()
    shown = {}
    for chunk in reader.stream(store=blueprint):
        batch = chunk.to_record_batch()
        if "ViewBlueprint:space_origin" in batch.schema.names:
            kind, origin = (
                batch.column(f"ViewBlueprint:{n}").to_pylist() for n in ("class_identifier", "space_origin")
            )
            shown.setdefault(kind[0][0], set()).add(origin[0][0])
    return shown
