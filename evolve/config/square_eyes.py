"""Settings of square eyes, which have one gene, "resolution", for the number of receptors along each side.

Other eyes have one gene for the height and one for the width. If the settings of a run contain equal settings for these
two genes, the settings are converted to settings of "resolution".
"""

from __future__ import annotations

from dataclasses import replace

from evolve.config.provenance import Source
from evolve.config.run_config import EyeConfig
from evolve.genome.genes import SIDE, SIDES

__all__ = ["no_such_side", "with_square_eyes"]


def with_square_eyes(source: Source, eye: EyeConfig) -> Source:
    """Return settings adapted to square eyes, which have one gene for height and width, `resolution`.

    If the source has equal settings for the genes `resolution_height` and `resolution_width`, these become settings of
    the gene `resolution`. Unequal settings are kept, and later cause an error, which `no_such_side` explains. If eyes
    are not square, the source is returned unchanged.

    A task or a preset may be written for eyes with one row of receptors. If a user selects square eyes, the task's
    default settings of the two genes are removed. If a preset has settings of `resolution_width` only, these become
    settings of `resolution`.
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
    """Return a message that explains why these eyes lack a gene for their numbers of receptors.

    Square eyes lack the separate genes for height and width. Other eyes lack the common gene for both sides.

    name: name of the missing gene
    """
    if eye.square:
        return f"genome.{name}: square eyes have the gene {SIDE} for both sides; set it, or eye.square = false"
    return f"genome.{name}: only square eyes have this gene, others have {' and '.join(SIDES)}; set eye.square = true"
