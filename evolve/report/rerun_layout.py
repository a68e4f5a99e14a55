"""Layout in which the viewer Rerun shows a recording: the world, numbers over time, and the images of each eye."""

from __future__ import annotations

from typing import Any

from evolve.episodes.episode import Episode
from evolve.report.rerun_bodies import EYES

__all__ = ["layout"]

ACROSS = 4  # maximum number of eyes side by side


def layout(rr: Any, episode: Episode) -> Any:
    """Return a blueprint (Rerun's description of a layout) for the entities that `rerun_recording` logs.

    Without a blueprint, the viewer would superimpose the images of all eyes.

    rr: the package `rerun`
    """
    import rerun.blueprint as views

    names = episode.eyes.names()

    def grid(name: str, above: tuple[str, ...], kind: Any = views.Spatial2DView) -> Any:
        shown = [kind(origin=rr.new_entity_path([*above, eye]), name=eye) for eye in names]
        return views.Grid(*shown, grid_columns=min(len(names), ACROSS), name=name)

    as_numbers = grid("signals as numbers", ("signals",), views.TensorView)
    clean = "behind perfect lenses" if episode.eyes.ommatidium is None else "without noise"
    scenes = grid(f"the scene, at the latest of {len(episode.radiance_frames)} times", ("scene",))
    seen = views.Vertical(
        views.Tabs(grid("signals of the eyes", EYES), as_numbers),
        views.Tabs(grid(clean, ("perfect_lens",)), scenes),
    )
    world = views.Spatial3DView(origin="/world", name="world")
    over_time = ("reward", "action", *episode.beside)
    numbers = [views.TimeSeriesView(origin=rr.new_entity_path([entity]), name=entity) for entity in over_time]
    ended = views.TextLogView(origin="/outcome", name="outcome")
    done = views.Vertical(world, views.Tabs(*numbers, ended), row_shares=[2, 1])
    return views.Blueprint(
        views.Horizontal(done, seen),
        views.TimePanel(timeline="time", state="collapsed"),
        views.BlueprintPanel(state="collapsed"),
        views.SelectionPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )
