"""The page of tracks shows the stored tracks, and their mazes contain them."""

from pathlib import Path

import numpy as np
import pytest

from evolve.episodes.tracks import Track
from experiments import eye_tracks
from experiments.eye_tracks import ANIMALS, DETECTIONS, EPISODES, EVERY, MAZES, Place, Played, page
from experiments.store import Origin, read_rows
from sim.worlds.ground_plan import GroundPlan

DATA = Path(__file__).parents[2] / "docs/results/data/eye_tracks.csv"
PLAN = GroundPlan(np.zeros((1, 4)), (0.0, 0.0, 9.0, 9.0), None, ("goal",), (0.5,), (1,), 0.2)


@pytest.fixture(scope="module")
def stored():
    return read_rows(Played, DATA), read_rows(Place, DATA.with_stem("eye_tracks_places"))


def test_the_page_is_made_from_the_stored_tracks(stored, tmp_path):
    answer = DATA.with_suffix(".txt").read_text(encoding="utf-8").strip()
    made = page(*stored, Origin.read(DATA.with_suffix(".json")), answer)
    assert made.markdown == (DATA.parents[1] / "eye_tracks.md").read_text(encoding="utf-8")
    for figure in made.figures:
        figure.draw(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 20_000


def test_tracks_lie_in_the_corridors_of_their_mazes_and_solved_ones_end_at_the_goal(stored):
    played, places = stored
    for animal in ANIMALS:
        own = [one for one in played if (one.task, one.animal) == ("maze", animal)]
        assert len(own) == EPISODES
        mazes = eye_tracks._by_maze(own, places)
        assert len(mazes) == MAZES
        for plan, episodes in mazes:
            for one in episodes:
                track = eye_tracks._track(one, places)
                for x, y, half_x, half_y in plan.walls:
                    assert not ((np.abs(track - (x, y)) < (half_x, half_y)).all(axis=1)).any()
                x0, y0, x1, y1 = plan.goal_region
                fast = 2.0  # way of the last action [m], before which the last position is stored
                near = x0 - fast <= track[-1, 0] <= x1 and y0 <= track[-1, 1] <= y1
                assert near == bool(one.solved)
                assert np.linalg.norm(np.diff(track, axis=0), axis=1).sum() <= one.length + 1e-3


def test_stored_rows_are_the_tracks():
    position = np.column_stack([np.arange(10.0), np.zeros(10)])
    track = Track(position, np.full((10, 1, 2), 3.0), 5.0, True, PLAN)
    assert eye_tracks._played("detection", "fine", 4, track) == Played(
        "detection", "fine", 4, 5.0, 1, 9.0, "3.000 3.000"
    )
    places = eye_tracks._places("detection", "fine", 4, track)
    assert [(one.step, one.x) for one in places] == [(0, 0), (EVERY, EVERY), (2 * EVERY, 2 * EVERY), (9, 9)]
    assert eye_tracks._drawn("detection", [track] * 5) == list(range(DETECTIONS))
    assert eye_tracks._points("1 2,3 4").tolist() == [[1, 2], [3, 4]]
    assert eye_tracks._points("").shape == (0, 2)


def test_without_stored_tracks_the_command_names_the_option(tmp_path, capsys):
    assert eye_tracks.main(["--docs", str(tmp_path)]) == 2
    assert "contains no episodes; compute them with --compute" in capsys.readouterr().err
