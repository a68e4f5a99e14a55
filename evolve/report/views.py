"""Images at one time of an episode: the scene in front of each eye, and signals behind a perfect and its own lens."""

from __future__ import annotations

import numpy as np

import optics
from evolve.analysis.episode import Episode
from evolve.analysis.statistics import psnr
from evolve.report.hints import hint
from evolve.report.markup import Html, html, joined, rounded, style
from evolve.report.picture import data_uri, display

__all__ = ["through_optics", "what_it_sees"]

WIDTH = 120  # width of one image in CSS pixels if there are few eyes
MOST_EYES = 6


def what_it_sees(episode: Episode) -> Html:
    """Return the images with their caption."""
    frame = _busiest(episode)
    time = int(episode.radiance_frames[frame])
    lens, names, gain = episode.eyes.eye(), episode.eyes.names(), episode.gain
    shown = range(min(len(names), MOST_EYES))
    rows = joined(_row(episode, eye, names[eye], frame, lens) for eye in shown)
    brighter = f", brightened {rounded(gain)} times (1/a²)" if gain != 1 else ""
    rest = f" The first {MOST_EYES} of {len(names)} eyes." if len(names) > MOST_EYES else ""
    quality = psnr(episode.signals, episode.perfect_signals, gain)
    caption = html(
        "<b>Views</b> at {} s of the episode above, left to right: the scene's {}, finely sampled; its {}’ {}s "
        "behind a perfect lens; the signals behind its own optics, without noise{}; and the same signals with noise, "
        "which are the input of the brain.{} Over the whole episode the signals have a PSNR of {} dB relative to those "
        "of the perfect lens.",
        *(rounded(time * episode.seconds), hint("radiance"), hint("receptor", "receptors"), hint("signal")),
        *(brighter, rest, rounded(quality)),
    )
    return html('<figure class="views"><div class="eyes">{}</div><figcaption>{}</figcaption></figure>\n', rows, caption)


def _busiest(episode: Episode) -> int:
    """Return the recorded frame with the largest variance along the horizon, in which the eyes see most detail.

    Variance in the vertical direction is ignored, because every frame shows the sky above the floor.
    """
    return int(np.argmax(episode.radiance.mean(axis=2).var(axis=-1).mean(axis=(1, 2))))


def _row(episode: Episode, eye: int, name: str, frame: int, lens: optics.Eye) -> Html:
    time = episode.radiance_frames[frame]
    scene = np.einsum("cb,byx->cyx", lens.spectral_bands.weights, episode.radiance[frame, eye])
    gain = 1 / lens.white_signal
    pictures = (
        ("scene", display(scene)),
        ("perfect lens", display(episode.perfect_signals[time, eye])),
        ("own optics, no noise", display(through_optics(lens, episode.radiance[frame, eye]), gain)),
        ("own optics, noise", display(episode.signals[time, eye], gain)),
    )
    height, width = episode.signals.shape[-2:]
    scale = WIDTH / max(height, width)
    size = style(f"width:{scale * width:.4g}px;aspect-ratio:{width}/{height}")
    cells = joined(
        html('<div><img src="{}" {} alt="{} eye: {}"><span>{}</span></div>', data_uri(pixels), size, name, label, label)
        for label, pixels in pictures
    )
    return html('<div class="sight"><span class="name">{}</span><div class="pair">{}</div></div>', name, cells)


def through_optics(eye: optics.Eye, radiance: np.ndarray) -> np.ndarray:
    """Return noise-free signals (channel, h, w) of the radiance (band, y, x) in front of an eye.

    Beyond the image's edge the scene continues with the values at the edge, as far as the eye's kernel extends (at most
    the width of the image).
    """
    samples = radiance.shape[-1] // eye.resolution[1]
    reach = min(max(eye.kernel(samples).shape[1:]) // 2, radiance.shape[-1])
    # Cells may be wider than a rhabdom's receptive field, so that their centres would not represent it.
    sight = eye.sight(samples, light_from="centres" if eye.waveguide is None else "cells")
    return eye.see(np.pad(radiance, ((0, 0), (reach, reach), (reach, reach)), mode="edge"), samples, sight=sight)
