"""A video shows the episode: the agent's position and its eyes' signals, with the correct duration."""

import sys
from dataclasses import replace

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image, ImageSequence

from evolve.config.run_config import ConfigError
from evolve.episodes.episode import Pictures
from evolve.report.moving_picture import GAP, HEIGHT, INSET, LONGEST, SPEED, _frame, _frames, write_gif, write_mp4
from evolve.report.picture import display
from evolve.report.theme import INK, PAPER

BACKGROUND = int(PAPER[1:3], 16)


@pytest.fixture(scope="module")
def short(episode):
    """Return the episode's first 24 actions."""
    cut = {
        name: value[:24] for name, value in vars(episode).items() if isinstance(value, np.ndarray) and len(value) == 256
    }
    terms, beside = ({name: term[:24] for name, term in of.items()} for of in (episode.reward_terms, episode.beside))
    return replace(episode, **cut, reward_terms=terms, beside=beside)


@pytest.fixture(scope="module")
def frames(short, tmp_path_factory):
    path = write_gif(short, tmp_path_factory.mktemp("gif") / "episode.gif")
    with Image.open(path) as picture:
        assert picture.info["loop"] == 0
        return [(f.convert("RGB"), f.info["duration"]) for f in ImageSequence.Iterator(picture)]


def test_it_lasts_as_long_as_the_episode(short, frames):
    assert sum(pause for _, pause in frames) == pytest.approx(1000 * len(short) * short.seconds / SPEED, rel=0.01)
    assert len(frames) == 24 < LONGEST


def test_the_agent_is_where_it_was(short, frames):
    """The darkest spot of the world is the agent's body."""
    x0, _, _, y1 = (plan := short.plan).bounds
    scale = HEIGHT / (y1 - plan.bounds[1])
    dark = tuple(int(INK[i : i + 2], 16) for i in (1, 3, 5))
    assert len(frames) == len(short)
    for time in (0, 12, 23):
        x, y = (short.position[time, 0] - x0) * scale, (y1 - short.position[time, 1]) * scale
        assert np.abs(np.subtract(frames[time][0].getpixel((round(x), round(y))), dark)).max() < 40
    assert np.hypot(*(short.position[23] - short.position[0])) * scale > 10, "the agent has moved"


def test_the_eyes_are_beside_it(short, frames):
    """Two eyes fill the part on the right, one above the other, without interpolation between receptors."""
    plan, receptors = short.plan.bounds, display(short.signals, short.gain)[12]
    width = round((plan[2] - plan[0]) * HEIGHT / (plan[3] - plan[1]))
    high = (HEIGHT - GAP) // 2
    wide = round(high * short.eyes.field_aspect)
    assert frames[12][0].size == (width + GAP + wide, HEIGHT)
    for number, eye in enumerate(receptors):
        y, x = 0.5 + np.indices(eye.shape[:2]).reshape(2, -1)
        at = zip(number * (high + GAP) + y * high / len(eye), width + GAP + x * wide / len(eye[0]), strict=True)
        pixels = [frames[12][0].getpixel((int(right), int(down))) for down, right in at]
        errors = [np.abs(np.subtract(pixels, one.reshape(-1, 3))).mean() for one in (eye, receptors[1 - number])]
        assert errors[0] < 16, "the palette has few colours"
        assert errors[0] < 0.5 * errors[1], "eyes are in order"


@pytest.mark.parametrize(
    ("eyes", "aspect", "columns", "rows"), [(1, 1.0, 1, 1), (4, 1.0, 2, 2), (3, 4.0, 1, 3), (12, 1.0, 3, 4)]
)
def test_eyes_are_as_large_as_possible(eyes, aspect, columns, rows):
    """Each eye's colour is its number, so that rows and columns can be counted."""
    seen = np.broadcast_to(np.arange(1, eyes + 1, dtype=np.uint8)[:, None, None, None], (eyes, 2, 2, 3))
    picture = np.asarray(_frame(Image.new("RGB", (0, HEIGHT)), seen, aspect))[..., 0]
    assert len(set(picture[5]) - {BACKGROUND}) == columns
    assert len(set(picture[:, GAP + 2]) - {BACKGROUND}) == rows
    assert set(np.unique(picture)) - {BACKGROUND} == set(range(1, eyes + 1))


def test_a_rendered_world_has_the_plan_in_its_corner(short):
    """The latest image is on the left, with the plan in its corner, and the eyes are the same as without the image."""
    pixels = np.empty((12, HEIGHT, 400, 3), np.uint8)
    pixels[:] = np.arange(12, dtype=np.uint8)[:, None, None, None] * 20
    plain = [np.asarray(one) for one in _frames(short, 12)]
    drawn = [np.asarray(one) for one in _frames(replace(short, pictures=Pictures(np.arange(0, 24, 2), pixels)), 12)]
    for image, seen, alone in zip((0, 6), drawn, plain, strict=True):
        eyes = seen[:, 400:]
        np.testing.assert_array_equal(eyes, alone[:, -eyes.shape[1] :])
        assert (seen[: HEIGHT // 2, :400] == 20 * image).all()
        whole = Image.fromarray(alone[:, : -eyes.shape[1]])
        size = round(INSET * whole.width), round(INSET * HEIGHT)
        corner = seen[HEIGHT - GAP - size[1] : HEIGHT - GAP, GAP : GAP + size[0]]
        assert np.abs(corner.astype(int) - whole.resize(size, Image.Resampling.LANCZOS)).max() == 0
        assert (seen[HEIGHT - GAP :, :400] == 20 * image).all()


def test_a_film_has_a_frame_for_every_action(short, frames, tmp_path):
    """It shows the same images as the GIF, as far as its compression allows, with the same duration."""
    path = write_mp4(short, tmp_path / "episode.mp4")
    assert [file.name for file in tmp_path.iterdir()] == ["episode.mp4"], "a partial file remains"
    film = imageio_ffmpeg.read_frames(str(path))
    told = next(film)
    width, height = told["source_size"]
    assert told["codec"].startswith("h264")
    assert told["pix_fmt"].startswith("yuv420p"), "players support only this format"
    shown = [np.frombuffer(frame, np.uint8).reshape(height, width, 3) for frame in film]
    assert len(shown) == len(short)
    assert told["duration"] == pytest.approx(len(short) * short.seconds / SPEED, rel=0.02)
    for time in (0, 12, 23):
        still = np.asarray(frames[time][0])[:height, :width].astype(float)
        other = np.asarray(frames[23 - time][0])[:height, :width].astype(float)
        errors = [np.sqrt(np.mean((shown[time] - picture) ** 2)) for picture in (still, other)]
        assert errors[0] < 12, "the palette's steps of 51 levels, and the compression"
        assert time == 12 or errors[0] < 0.9 * errors[1], "frames are in order"


def test_a_film_without_ffmpeg_names_the_extra(monkeypatch, short, tmp_path):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(ConfigError, match=r"--mp4 needs ffmpeg: pip install 'rhabdom\[video\]'"):
        write_mp4(short, tmp_path / "episode.mp4")
    assert list(tmp_path.iterdir()) == []
