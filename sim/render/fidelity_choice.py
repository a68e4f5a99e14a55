"""As little work as the receptors' noise allows: how many bands, depth layers and samples a scene needs for given eyes,
and how much of its light.

An error below half of the noise changes nothing that the brain can tell. Every stage has levels, cheapest first; the
cheapest whose predicted error fits is taken, and what was chosen is on record with its reason. Which levels there are,
and how their errors are found, differs between scenes (`world_fidelity`, `model_fidelity`); how they are chosen does
not.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import Protocol

import optics
from sim.eyes.depth_layers import DepthLayers
from sim.render.fidelity import Fidelity, Level


class FidelityWarning(UserWarning):
    """No level that is known keeps the error within what was allowed."""


@dataclass(frozen=True)
class Samples:
    """The choice of rays or areas.

    kind: "rays", "areas" or "edges" · light, level: what was chosen, and why · number: for each receptor
    enough: whether they err by no more than was allowed
    """

    kind: str
    light: Level
    number: float
    level: Level
    enough: bool

    @property
    def error(self) -> float:
        """With the light that is left out."""
        return math.hypot(self.light.predicted_error or 0, self.level.predicted_error or 0)


@dataclass(frozen=True)
class Allowed:
    """Error allowed to the samples (root mean square), and where no light is left out."""

    error: float
    without_light: float


@dataclass(frozen=True)
class Shares:
    """Parts of the tolerance that the stages before the samples may use up. Errors add up as squares, and samples may
    use the rest."""

    bands: float
    depth: float
    light: float

    def left(self, allowed: float, has_layers: bool, light: float) -> Allowed:
        """Divide an allowed error: the rest for samples; light: error of the light that is left out."""
        spent = self.bands**2 + (self.depth**2 if has_layers else 0)
        for_light = min(light / allowed, self.light) ** 2
        return Allowed(allowed * math.sqrt(1 - (spent + for_light)), allowed * math.sqrt(1 - spent))


class Stages(Protocol):
    """Levels of fidelity that a scene offers, and their errors.

    eye: whose receptors' noise decides · allowed: error of a signal, all stages together (root mean square)
    shares: of it; None: stages are judged one by one, and each may use all of it
    """

    eye: optics.Eye
    allowed: float
    shares: Shares | None

    def bands(self) -> Level:
        """The eye's own, and what they are worth."""

    def depth(self, allowed: float) -> tuple[DepthLayers, Level | None]:
        """Layers that the eye has a PSF for; no level where there is nothing to choose."""

    def light(self, depth: DepthLayers, allowed: float) -> Level:
        """The light that is followed."""

    def samples(self, depth: DepthLayers, light: Level, allowed: Allowed) -> Samples:
        """How many."""


def cheapest(stages: Stages) -> Fidelity:
    """The cheapest level of each stage whose predicted error is allowed; a FidelityWarning says where there is none."""
    allowed, shares = stages.allowed, stages.shares
    depth, depth_level = stages.depth(allowed * (shares.depth if shares else 1))
    light = stages.light(depth, allowed * (shares.light if shares else 1))
    left = Allowed(allowed, allowed)
    if shares:
        left = shares.left(allowed, stages.eye.pupil is not None, light.predicted_error or 0)
    samples = stages.samples(depth, light, left)
    levels = [level for level in (stages.bands(), depth_level, samples.light, samples.level) if level is not None]
    bands = stages.eye.bands
    found = Fidelity(samples.number, bands, depth, allowed, tuple(levels), samples.light.level, samples.kind)
    # Of the bands' error only a bound is known, which may be far above it.
    _warn_if_worse(levels[1:], allowed, together=shares is not None)
    return found


def _warn_if_worse(levels: list[Level], allowed: float, together: bool) -> None:
    errors = [level.predicted_error or 0 for level in levels]
    worst = math.hypot(*errors) if together else max(errors)
    if worst > allowed * (1 + 1e-9):
        lead = max(levels, key=lambda level: level.predicted_error or 0)
        warnings.warn(
            f"the best fidelity that pays errs by {worst:.1e} of a signal, {worst / allowed:.1f} times what is "
            f"allowed, {allowed:.1e}: mostly {lead.stage}, {lead.level} ({lead.why})",
            FidelityWarning,
            stacklevel=4,
        )
