"""Rendered images of an episode on a page: the figure that shows them, and the data for the player."""

from __future__ import annotations

import base64
import io
from typing import Any

import numpy as np
from PIL import Image

from evolve.episodes.episode import Pictures
from evolve.report.markup import Html, html, style
from evolve.report.picture import SHEET_WIDTH

__all__ = ["figure_of_pictures", "film_of_pictures"]

WIDTH = 320  # [pixels] width of an image on a page
QUALITY = 80  # quality of JPEG; artefacts are invisible at this size of the images


def figure_of_pictures(pictures: Pictures) -> Html:
    """Return the figure in which player.js shows the images."""
    height, width = _size(pictures)
    caption = html(
        "<b>The animal at its task</b>, rendered by the task's camera, which follows the animal in built-in tasks. "
        "Dots mark its eyes. Each eye has a colour, which marks the rim of its field of view, or the floor that it "
        "sees."
    )
    return html(
        '<figure><canvas class="pictures" role="img" aria-label="The animal at its task, with its eyes and '
        'the rims of their fields of view" {}></canvas><figcaption>{}</figcaption></figure>\n',
        *(style(f"aspect-ratio:{width}/{height}"), caption),
    )


def film_of_pictures(pictures: Pictures, kept: np.ndarray) -> dict[str, Any]:
    """Return the part of the data for player.js that contains the images.

    kept: time steps that the player shows, in ascending order
    """
    size = _size(pictures)
    columns = max(1, min(len(pictures.pixels), SHEET_WIDTH // size[1]))
    shown = np.searchsorted(pictures.times, kept, side="right") - 1
    return {
        "pictures": {"size": size, "columns": columns, "shown": shown.tolist()},
        "sheets": {"pictures": _jpeg(_sheet(pictures.pixels, size, columns))},
    }


def _size(pictures: Pictures) -> tuple[int, int]:
    """Return the size of the images on a page, (height, width) [pixels]."""
    height, width = pictures.pixels.shape[1:3]
    return round(WIDTH * height / width), WIDTH


def _sheet(pictures: np.ndarray, size: tuple[int, int], columns: int) -> Image.Image:
    """Return a sheet that contains all images, row by row."""
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
