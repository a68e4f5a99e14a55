"""What the words of a report mean: shown where somebody points at one of them, or comes to it by the keyboard."""

from __future__ import annotations

from evolve.report.markup import Html, html

__all__ = ["MEANINGS", "hint"]

# Each is a word of docs/glossary.md, here in a sentence for who has not read it.
MEANINGS = {
    "fitness": "what an animal earns in an evaluation episode after it has learnt, on average; the more, the better",
    "candidate": "one genome of the run with the animal that it became, trained and evaluated",
    "generation": "the candidates that are proposed together, from what the ones before have earned",
    "genome": "the numbers that evolution varies; an animal's eyes and brain follow from them",
    "phenotype": "the eyes and the brain that a genome becomes",
    "receptor": "one light-sensitive cell of an eye: a pixel of what the animal sees",
    "acuity": "the finest stripes that the receptors are close enough to tell, in pairs of stripes per degree",
    "relief": "the shape of the glass in the pupil; its thickness delays light and so can bend it to a focus",
    "psf": "point spread function: what becomes of the light of a distant point on the retina",
    "mtf": "modulation transfer function: how much contrast is left of stripes, the finer they are",
    "Strehl ratio": "brightness of the image of a point, as a share of what a perfect lens of that width would give",
    "radiance": "light that arrives from one direction; 1 is white in full daylight",
    "signal": "what a receptor reports to the brain, noise included",
    "bands": "ranges of wavelengths, each computed at one wavelength",
}


def hint(term: str, shown: str | None = None) -> Html:
    """A word with its meaning, written as `shown` if it is not to stand as it is."""
    return html('<dfn tabindex="0" aria-label="{}: {}">{}</dfn>', term, MEANINGS[term], shown or term)
