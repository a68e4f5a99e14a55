"""Explanations of terms in a report. They are shown when the pointer or the keyboard focus is on a term."""

from __future__ import annotations

from evolve.report.markup import Html, html

__all__ = ["MEANINGS", "hint"]

# docs/glossary.md also explains these terms. The sentences here must be understandable without any other definition.
MEANINGS = {
    "fitness": "mean return of an animal's evaluation episodes after training, minus costs, if any; higher is better",
    "candidate": "one genome of the run with the animal that develops from it, trained and evaluated",
    "generation": "the candidates that are proposed together, based on the fitness of earlier ones",
    "genome": "the numbers that evolution varies; they determine an animal's eyes and brain",
    "phenotype": "the eyes and the brain that develop from a genome",
    "receptor": "one light-sensitive cell of an eye, comparable to a pixel of a camera",
    "acuity": "the finest stripes that the spacing of receptors can resolve, in pairs of stripes per degree",
    "relief": "the shape of the glass in the pupil; its thickness delays light and can focus it",
    "psf": "point spread function: distribution of the light of a distant point on the retina",
    "mtf": "modulation transfer function: contrast of stripes in the image, depending on their fineness",
    "Strehl ratio": "peak brightness of the image of a point, relative to a perfect lens of the same width",
    "radiance": "light that arrives from one direction; 1 is white in full daylight",
    "signal": "the response of a receptor, noise included",
    "bands": "ranges of wavelengths, each computed at one wavelength",
}


def hint(term: str, shown: str | None = None) -> Html:
    """Return a term with its explanation.

    term: a key of MEANINGS
    shown: text in place of the term; None: the term itself
    """
    return html('<dfn tabindex="0" aria-label="{}: {}">{}</dfn>', term, MEANINGS[term], shown or term)
