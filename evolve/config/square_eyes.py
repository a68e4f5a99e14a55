"""Settings of square eyes, which have one gene for both sides. Equal settings of both sides apply to this gene."""

from __future__ import annotations

from dataclasses import replace

from evolve.config.provenance import Source
from evolve.config.run_config import EyeConfig
from evolve.genome.genes import SIDE, SIDES

__all__ = ["no_such_side", "with_square_eyes"]


def with_square_eyes(source: Source, eye: EyeConfig) -> Source:
    """Return the source, with the settings of height and width moved to the single gene of square eyes.

    If eyes are not square, the source is returned unchanged. Equal settings of height and width become settings of the
    single gene. Unequal settings are kept, and `no_such_side` explains the error that follows from them.

    A task or a preset may be written for eyes with one row of receptors. If a user selects square eyes, the task's
    settings of height and width are ignored, and the preset's width applies to both sides if the preset does not set
    the height.
    """
    genes = source.tree.get("genome", {})
    if eye.square and not source.name:
        return replace(source, tree={**source.tree, "genome": {k: v for k, v in genes.items() if k not in SIDES}})
    height, width = (genes.get(name) for name in SIDES)
    if eye.square and source.name.startswith("preset ") and height is None and width is not None and SIDE not in genes:
        height = width
    if not eye.square or height is None or height != width or SIDE in genes:
        return source
    rest = {name: use for name, use in genes.items() if name not in SIDES}
    return replace(source, tree={**source.tree, "genome": {**rest, SIDE: height}})


def no_such_side(name: str, eye: EyeConfig) -> str:
    """Return a message that explains why these eyes lack a gene: that of a single side, or that of both sides."""
    if eye.square:
        return f"genome.{name}: square eyes have the gene {SIDE} for both sides; set it, or eye.square = false"
    return f"genome.{name}: only square eyes have this gene, others have {' and '.join(SIDES)}; set eye.square = true"
