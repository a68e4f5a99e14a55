"""Warnings about settings that are allowed but odd, because they have no effect or cause wrong colour signals."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from evolve.config.run_config import EyeConfig, RunConfig, SearchConfig
from evolve.genome.genes import INHERITED, LAMBDA_MAX, GeneConfig, highest
from optics.elements.turbid_medium import AIR, turbid_medium

__all__ = ["coarse_bands", "idle_genes", "idle_settings", "idle_starts", "lint"]

PEAKS = 17  # number of peak wavelengths of a pigment that are tested over the range of an open gene
SHOWN = 4  # maximum number of gene names in a line
# Possible error of the reference with 64 bands, relative to the signal of a white surface. Smaller errors are ignored.
LEAST_ERROR = 1e-3


def lint(config: RunConfig) -> list[str]:
    """Return warnings about settings that are allowed but odd, one line each; [] if there are none."""
    return [*idle_genes(config), *idle_starts(config), *idle_settings(config), *coarse_bands(config)]


def coarse_bands(config: RunConfig) -> list[str]:
    """Return a warning if there are so few spectral bands that errors of receptor signals exceed the receptors' noise.

    Errors up to 0.001 of the signal of a white surface are ignored. The result is a list with one line, or [].

    Errors are computed for the surfaces of the task's world that have a measured spectrum. If the run's medium is not
    air, errors are also computed for white and black surfaces that are seen through the medium. In air, there is no
    warning for user tasks, whose reflectances are unknown, nor for worlds in which all surfaces are grey.
    """
    if config.card.grey is not False and config.world.medium == AIR:  # reflectances are unknown, or grey
        return []
    from sim.scene.band_error import band_error, measured
    from sim.worlds.world import build_world

    medium, spectra = turbid_medium(config.world.medium), []
    if config.card.grey is False:
        world = build_world(config.task)
        spectra = measured(world.model, world.spectra)

    def error_with(bands: int) -> float:
        found = [band_error(spectra, types, bands) for types in _types(config)]
        found += [medium.band_error(bands, types) for types in _types(config)] if medium else []
        return max(found)

    light, counts = _most_light(config), _doublings(config.eye.bands)
    errors = {n: light * error_with(n) for n in counts}
    error, allowed = errors[config.eye.bands], max(config.eye.noise_sigma, LEAST_ERROR)
    if error <= allowed:
        return []
    enough = next((f"{n} bands are enough" for n, left in errors.items() if left <= allowed), None)
    remedy = enough or f"even {max(errors)} bands are not enough"
    return [
        f"eye.bands = {config.eye.bands}: signals of {config.task}'s objects have errors up to {error:.2g} of "
        f"white's signal, more than a receptor's noise, {allowed:g}; {remedy}"
    ]


def _most_light(config: RunConfig) -> float:
    """Return the largest signal that a white surface can cause in an eye of this search.

    In a camera eye, it is the signal behind the widest pupil that the genes allow, relative to the signal behind a
    pupil with relative aperture 1. With perfect lenses and in compound eyes, the signal of white is always 1.
    """
    if not config.eye.optics or config.eye.compound:
        return 1.0
    return highest("relative_aperture", config.genome) ** 2


def _doublings(bands: int) -> list[int]:
    """Return `bands`, and all numbers below 64 that follow from it by repeated doubling.

    Errors are computed relative to a reference with 64 bands.
    """
    return [bands * 2**k for k in range(6) if k == 0 or bands * 2**k < 64]


def _types(config: RunConfig) -> list[str | tuple[float, ...]]:
    """Return the sets of receptor types for which `coarse_bands` computes errors of signals.

    A set is a name such as "rgb", or the peak wavelengths of the types [nm]. If genes determine these peaks, the genes
    that the search varies are changed one at a time: one takes several values over its range, while the others keep
    their start values. Other combinations may cause larger errors. In the preset `ultraviolet`, whose peaks lie far
    apart, a test of all combinations would find an error that is a third larger.
    """
    if config.eye.receptors != INHERITED:
        return [config.eye.receptors]
    uses = [config.genome[name] for name in LAMBDA_MAX]
    count = config.genome["receptor_types"]
    start = [use.start for use in uses][: int(count.high if count.open else count.start)]
    tried = [tuple(start)]
    for place in range(len(start)):
        if uses[place].open:
            peaks = np.linspace(uses[place].low, uses[place].high, PEAKS)
            tried += [(*start[:place], float(peak), *start[place + 1 :]) for peak in peaks]
    return list(tried)


def idle_genes(config: RunConfig) -> list[str]:
    """Return warnings about open genes (genes that the search varies) that have no effect.

    They have no effect because of the values of other genes, or because of the world.
    """
    uses, table = config.genome, config.genes
    notes = []
    if uses["placement_range_deg"].open and not uses["n_eyes"].open and uses["n_eyes"].start == 1:
        notes.append("genome.placement_range_deg is open but has no effect: genome.n_eyes is fixed at 1")
    if not config.eye.compound:
        notes += _idle_glass(uses, [name for name in table if name.startswith("doe_")])
    grey = config.card.grey and config.world.medium == AIR
    if grey and any(uses[name].open for name in LAMBDA_MAX):
        notes.append(f"genes of lambda_max are open but have no effect: the world of {config.task} is grey")
    types = uses["receptor_types"]
    most = int(types.high if types.open else types.start)
    for name in [name for name in list(LAMBDA_MAX)[most:] if uses[name].open]:
        notes.append(f"genome.{name} is open but has no effect: genome.receptor_types is at most {most}")
    return notes


def _idle_glass(uses: Mapping[str, GeneConfig], relief: list[str]) -> list[str]:
    """Return warnings about genes of a pupil's relief that the search varies although they have no effect.

    If the refractive index is fixed at 1, the genes of the heights and of dispersion have no effect. If the relief is
    fixed and flat, the two genes of its material (refractive index and dispersion) have no effect.

    relief: names of the genes of the heights
    """
    notes, index = [], uses["refractive_index"]
    if not index.open and index.start == 1 and any(uses[name].open for name in (*relief, "dispersion")):
        notes.append("the relief's open genes have no effect: genome.refractive_index is fixed at 1")
    flat = not any(uses[name].open for name in relief) and len({uses[name].start for name in relief}) == 1
    for name in ("refractive_index", "dispersion"):
        if flat and uses[name].open:
            notes.append(f"genome.{name} is open but has no effect: the relief is fixed and flat")
    return notes


def idle_settings(config: RunConfig) -> list[str]:
    """Return warnings about settings that were changed although they have no effect."""
    notes, search, eye = [], config.search, config.eye
    for name, gene in config.genes.items():
        use, alike = config.genome[name], [other for other in config.genes.values() if other.cluster == gene.cluster]
        # If `opens_at` is the same for all genes of a cluster, it was probably set for the whole cluster, for the sake
        # of its open genes. The frozen genes then cause no warning.
        together = {config.genome[other.name].opens_at for other in alike} == {use.opens_at}
        if use.opens_at and not use.open and not gene.default.open and not together:
            notes.append(f"genome.{name}.opens_at has no effect: the gene is frozen; set genome.{name}.open = true")
    if search.rungs == 1 and search.promoted != SearchConfig.promoted:
        notes.append("search.promoted has no effect: search.rungs = 1")
    if search.active and search.optimizer != "CMA":
        notes.append(f"search.active has no effect: search.optimizer = {search.optimizer}")
    if not eye.optics:
        of_pupils = ("relief_height", "relief_points", "relief_symmetric", "pupil_turned")
        given = [name for name in of_pupils if getattr(eye, name) != getattr(EyeConfig, name)]
        notes += [f"eye.{name} has no effect: eye.optics = false" for name in given]
    return notes


def idle_starts(config: RunConfig) -> list[str]:
    """Return warnings about genes that have no effect although their start values were changed, one line per cause.

    Optical genes have no effect without optics, and spectral genes have none if receptor types are not inherited.
    """
    unread = {"optical": f"eye.optics = {config.eye.optics}".lower()} if not config.eye.optics else {}
    if config.eye.receptors != INHERITED:
        unread["spectral"] = f"eye.receptors = {config.eye.receptors}, not {INHERITED}"
    notes = []
    for cluster, why in unread.items():
        genes = [gene for gene in config.genes.values() if gene.cluster == cluster]
        given = [g.name for g in genes if config.genome[g.name].start != g.default.start]
        if given:
            names = ", ".join(given if len(given) < SHOWN else [*given[: SHOWN - 1], "..."])
            notes.append(f"the start of {names} has no effect: {why}")
    return notes
