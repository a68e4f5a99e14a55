"""Choice of the cheapest fidelity, in four stages: bands, depth layers, light and samples.

By default, the allowed error is half of the receptors' noise. A brain could not distinguish such an error from the
noise. Every stage has levels, ordered by cost. The cheapest level whose predicted error is allowed is chosen, and
stored with the reason. The available levels and their errors depend on the kind of scene (`world_fidelity`,
`model_fidelity`). The rule for choosing a level is the same for all scenes (`cheapest`). Environments without a given
fidelity apply this rule (`sim.envs.prepared_task`), and so do user tasks with the setting "auto"
(`sim.tasks.task_fidelity`).
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
    """Warning that no available level keeps the error within the tolerance."""


@dataclass(frozen=True)
class Samples:
    """The chosen samples: rays, areas or adaptive edge sampling.

    kind: "rays", "areas" or "edges"
    light, level: chosen levels of light and of samples
    number: number of samples per receptor
    enough: True if the error is at most the allowed one
    """

    kind: str
    light: Level
    number: float
    level: Level
    enough: bool

    @property
    def error(self) -> float:
        """Error due to the samples and to the omitted light."""
        return math.hypot(self.light.predicted_error or 0, self.level.predicted_error or 0)


@dataclass(frozen=True)
class Allowed:
    """Allowed error of the samples (root mean square).

    error: allowed error if some light is omitted, which also uses a part of the tolerance
    without_light: allowed error if no light is omitted
    """

    error: float
    without_light: float


@dataclass(frozen=True)
class Shares:
    """Fractions of the tolerance that the stages before the samples may use.

    Errors of different stages are independent, so their squares add up. The samples may use the remainder.
    """

    bands: float
    depth: float
    light: float

    def left(self, allowed: float, has_layers: bool, light: float) -> Allowed:
        """Return the remainder of an allowed error, which the samples may use.

        allowed: allowed error of all stages together
        has_layers: True if the eye has depth layers
        light: error due to the omitted light
        """
        spent = self.bands**2 + (self.depth**2 if has_layers else 0)
        for_light = min(light / allowed, self.light) ** 2
        return Allowed(allowed * math.sqrt(1 - (spent + for_light)), allowed * math.sqrt(1 - spent))


class Stages(Protocol):
    """Levels of fidelity that a scene offers, and their errors.

    eye: its receptor noise determines the allowed error
    allowed: allowed error of a signal due to all stages (root mean square)
    shares: fractions of the allowed error; None: each stage may use all of it

    In the methods, `allowed` is the largest error that the stage may cause.
    """

    eye: optics.Eye
    allowed: float
    shares: Shares | None

    def bands(self) -> Level:
        """Return the level for the eye's own bands, with their predicted error if it is known."""

    def depth(self, allowed: float) -> tuple[DepthLayers, Level | None]:
        """Return the depth layers for which the eye has a PSF, and the chosen level (None if there was no choice)."""

    def light(self, depth: DepthLayers, allowed: float) -> Level:
        """Return the level of light: which reflections are followed."""

    def samples(self, depth: DepthLayers, light: Level, allowed: Allowed) -> Samples:
        """Return the kind and number of samples."""


def cheapest(stages: Stages) -> Fidelity:
    """Return the fidelity with the eye's own bands, and the cheapest level with an allowed error of each other stage.

    If these levels exceed the allowed error, a FidelityWarning states by how much.
    """
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
    # The error of the bands is not included: only an upper bound is known, which may be much larger than the error.
    _warn_if_worse(levels[1:], allowed, together=shares is not None)
    return found


def _warn_if_worse(levels: list[Level], allowed: float, together: bool) -> None:
    errors = [level.predicted_error or 0 for level in levels]
    worst = math.hypot(*errors) if together else max(errors)
    if worst > allowed * (1 + 1e-9):
        lead = max(levels, key=lambda level: level.predicted_error or 0)
        warnings.warn(
            f"the best available fidelity has an error of {worst:.1e} of a signal, {worst / allowed:.1f} times the "
            f"allowed {allowed:.1e}, mostly from {lead.stage}: {lead.level} ({lead.why})",
            FidelityWarning,
            stacklevel=4,
        )
