"""Light on what an area sees of a body: shadows, and what other bodies change, are found once for all of it; the rest
depends on how it slopes."""

from __future__ import annotations

from dataclasses import dataclass

from optics.numerics.autodiff import Array
from sim.tracing.areas.illumination import Illumination, Moment
from sim.tracing.areas.light_table import LightTable, sum_of
from sim.tracing.areas.patch import Patch


@dataclass(frozen=True)
class BodyLight:
    """illumination: straight from the lights · lit: share of each that reaches what is seen
    around: reflected light, harmonics in fours per component; none where it is not followed
    change: of it, per component, by other bodies
    """

    illumination: Illumination
    lit: list[Array]
    around: list[list[Array]]
    change: list[Array]

    @classmethod
    def of(
        cls, illumination: Illumination, reflected: LightTable | None, body: int, patch: Patch, now: Moment
    ) -> BodyLight:
        """Light on a patch that stands for what is seen of a body; body: its number."""
        lit = illumination.lit(patch, now, body)
        if reflected is None or now.inputs.reflected is None:
            return cls(illumination, lit, [], [])
        around = reflected.on_body(body, now.bodies[body], now.inputs.reflected)
        free = [sum_of(fours, patch.normal) for fours in around]
        left = illumination.past_bodies(patch, free, now, body)
        return cls(illumination, lit, around, [a - b for a, b in zip(left, free, strict=True)])

    def on(self, normal: Array) -> list[Array]:
        """Per component, where the body slopes like this."""
        light = self.illumination.arriving(normal, self.lit)
        if not self.around:
            return light
        parts = zip(light, self.around, self.change, strict=True)
        return [straight + sum_of(fours, normal) + change for straight, fours, change in parts]
