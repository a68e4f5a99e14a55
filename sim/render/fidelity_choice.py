"""Choice of the cheapest fidelity, in four stages: bands, depth layers, light and samples.

By default, the allowed error is half of the receptors' noise. A brain could not distinguish such an error from the
noise. Every stage has levels, ordered by cost. The cheapest level whose predicted error is allowed is chosen, and
stored with the reason. The available levels and their errors depend on the kind of scene (`world_fidelity`,
`model_fidelity`). The rule for choosing a level is the same for all scenes (`cheapest`). A fidelity is chosen in this
way in environments for which the user specifies no fidelity (`sim.envs.prepared_task`), and in user tasks whose setting
`fidelity` is "auto" (`sim.tasks.task_fidelity`).
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
    """Warning that even the most accurate rendering available has an error above the tolerance."""


@dataclass(frozen=True)
class Samples:
    """The kind and number of samples with which an eye's view is rendered, and the predicted error that they cause.

    kind: "rays", "areas" (rectangles of the visual field) or "edges" (rays, more of them for receptors that see an
        edge)
    light: record of how many reflections of light are followed, with the error due to further reflections
    number: number of samples per receptor
    level: record of the chosen kind and number as text for reports, with the predicted error and the reason
    enough: True if the error due to the samples does not exceed the allowed error
    """

    kind: str
    light: Level
    number: float
    level: Level
    enough: bool

    @property
    def error(self) -> float:
        """Error of a signal due to the samples and to the reflections that are not followed (root mean square)."""
        return math.hypot(self.light.predicted_error or 0, self.level.predicted_error or 0)


@dataclass(frozen=True)
class Allowed:
    """Upper limits of the root mean square error that the samples (rays or areas) may cause in a signal.

    error: limit if some reflections of light are omitted. It is smaller than `without_light`, because the omitted light
        already causes a part of the error that is allowed for all causes together.
    without_light: limit if no light is omitted
    """

    error: float
    without_light: float


@dataclass(frozen=True)
class Shares:
    """Limits of the errors due to bands, depth layers and omitted light, as fractions of the tolerance.

    The tolerance is the allowed error of a signal. These three errors and the error of the samples (rays or areas) are
    independent, so their squares add up. The limit for the samples is the part of the tolerance that the three others
    leave.
    """

    bands: float
    depth: float
    light: float

    def left(self, allowed: float, has_layers: bool, light: float) -> Allowed:
        """Return the largest error that the samples (rays or areas) may cause.

        It is the part of the allowed error that remains after the errors due to bands, depth layers and omitted light.

        allowed: allowed error of a signal due to all causes together
        has_layers: True if the eye has depth layers, which are distances for which it has a PSF
        light: error due to the reflections of light that are omitted
        """
        spent = self.bands**2 + (self.depth**2 if has_layers else 0)
        for_light = min(light / allowed, self.light) ** 2
        return Allowed(allowed * math.sqrt(1 - (spent + for_light)), allowed * math.sqrt(1 - spent))


class Stages(Protocol):
    """The stages in which the accuracy of rendering a scene is chosen, one method per stage.

    The stages are the spectral bands, the depth layers, the reflections of light, and the samples (rays or areas).

    eye: its receptor noise determines the allowed error
    allowed: allowed error of a signal due to all stages (root mean square)
    shares: fractions of the allowed error that single stages may use; None: each stage may use all of it

    In the methods, `allowed` is the largest error that the stage may cause.
    """

    eye: optics.Eye
    allowed: float
    shares: Shares | None

    def bands(self) -> Level:
        """Return a record of the number of spectral bands, and of the error due to this number if the error is known.

        The number of bands is not chosen: it is the number that the eye has.
        """

    def depth(self, allowed: float) -> tuple[DepthLayers, Level | None]:
        """Return the depth layers, and a record of their choice with the reason (None if there was no choice).

        Depth layers are the distances for which the eye has a PSF.
        """

    def light(self, depth: DepthLayers, allowed: float) -> Level:
        """Return a record of how many reflections of light are followed, the reason, and the error due to the rest."""

    def samples(self, depth: DepthLayers, light: Level, allowed: Allowed) -> Samples:
        """Return the kind and number of samples."""


def cheapest(stages: Stages) -> Fidelity:
    """Return the cheapest fidelity (accuracy of rendering) whose predicted error is allowed.

    The spectral bands are not chosen, but are those of the eye. The settings `depth`, `light` and `samples` of a
    Fidelity are chosen one after the other. For each of them, the result is the cheapest option whose predicted error
    is allowed. If no available option is accurate enough, a FidelityWarning states by how much the allowed error is
    exceeded.
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
