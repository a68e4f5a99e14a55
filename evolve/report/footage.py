"""An episode of a task of somebody's own, for people: pictures of it, and what its player needs of them."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from PIL import Image

import sim
from evolve.analysis.episode import Episode
from evolve.analysis.filmed_episode import FilmedEpisode
from evolve.report.ground_plan import GroundPlan
from evolve.report.markup import Html, html, look
from evolve.report.picture import SHEET_WIDTH

__all__ = ["AnyEpisode", "Footage", "Stage", "stage_of"]

WIDTH = 320  # pixels of a picture on a page
QUALITY = 80  # of JPEG: what is left of them is not seen at this size
AnyEpisode: TypeAlias = "Episode | FilmedEpisode"
Stage: TypeAlias = "GroundPlan | Footage"


@dataclass(frozen=True)
class Footage:
    """What stands in the place of a ground plan, where nobody knows what there is to draw.

    seconds: that one action lasts
    gain: 1/a²: what the pupil's area takes from the light
    size: of the pictures (height, width) [pixels]
    """

    eyes: sim.Eyes
    seconds: float
    gain: float
    size: tuple[int, int]

    @classmethod
    def of(cls, episode: FilmedEpisode) -> Footage:
        height, width = episode.pictures.shape[1:3]
        gain = 1 / float(episode.eyes.eye().white_signal)
        return cls(episode.eyes, episode.seconds, gain, (round(WIDTH * height / width), WIDTH))

    def figure(self) -> Html:
        """Where player.js shows the pictures."""
        caption = html(
            "<b>The animal at its task</b>, as the task's camera sees it. Dots mark its eyes, lines the rims of their "
            "fields of view; a colour is an eye."
        )
        return html(
            '<figure><canvas class="world" role="img" aria-label="The animal at its task, with its eyes and '
            'the rims of their fields of view" {}></canvas><figcaption>{}</figcaption></figure>\n',
            *(look(f"aspect-ratio:{self.size[1]}/{self.size[0]}"), caption),
        )

    def film(self, episode: FilmedEpisode, kept: np.ndarray) -> dict[str, Any]:
        """What player.js reads beside what all films have; over the frames that are kept."""
        columns = max(1, min(len(episode.pictures), SHEET_WIDTH // self.size[1]))
        shown = np.searchsorted(episode.picture_times, kept, side="right") - 1
        return {
            "pictures": {"size": self.size, "columns": columns, "shown": shown.tolist()},
            "action": np.round(episode.action[kept].astype(np.float64), 2).tolist(),
            "sheets": {"pictures": _jpeg(_sheet(episode.pictures, self.size, columns))},
        }


def stage_of(episode: AnyEpisode) -> Stage:
    """Where an episode plays."""
    return Footage.of(episode) if isinstance(episode, FilmedEpisode) else GroundPlan.of(episode)


def _sheet(pictures: np.ndarray, size: tuple[int, int], columns: int) -> Image.Image:
    """All pictures, as words stand on a page."""
    height, width = size
    sheet = Image.new("RGB", (columns * width, -(-len(pictures) // columns) * height))
    for number, picture in enumerate(pictures):
        small = Image.fromarray(picture).resize((width, height), Image.Resampling.LANCZOS)
        sheet.paste(small, (number % columns * width, number // columns * height))
    return sheet


def _jpeg(picture: Image.Image) -> str:
    content = io.BytesIO()
    picture.save(content, "JPEG", quality=QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(content.getvalue()).decode("ascii")
