"""Where an angular spectrum fades out before grazing incidence, so that a finite grid can carry it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from optics.methods.problem import Problem
from optics.numerics.autodiff import Array
from optics.numerics.precision import Precision, opaque

__all__ = ["FADES", "TAPER_END_SINE", "Taper", "tapers"]

# Choice. The taper must end this far from grazing incidence, where z tan θ has no bound.
TAPER_END_SINE = 0.9995
FADES = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0)  # choice: blurs to try, in units of the problem's size


@dataclass(frozen=True)
class Taper:
    """Where the spectrum fades out: from `band` over `width` [1/m], which blurs the field by `blur` [m].

    The fading is an error function whose derivative's transform falls to the ripple within the blur. What it removes
    must therefore land at least that far outside the window.
    """

    band: float
    width: float
    blur: float
    sine: float
    tangent: float

    @classmethod
    def of(cls, problem: Problem, blur: float) -> Taper:
        band, width = problem.band(blur), 2 * math.log(1 / problem.fade_ripple) / (math.pi * blur)
        sine = (band + width) * problem.wavelength
        return cls(band, width, blur, sine, sine / math.sqrt(max(1 - sine * sine, 1e-12)))

    @property
    def end(self) -> float:
        return self.band + self.width

    def fade(self, f2: Array, types: Precision) -> Array:
        """1 below the band, 0 beyond its end: the error function falls to the ripple in √ln(1/ripple).

        f2: f², float64.
        """
        import drjit as dr

        steepness = 2 / self.width * math.sqrt(math.pi * self.width * self.blur / 2)
        middle = self.band + self.width / 2
        # f - m = (f² - m²) / (f + m): a root of few digits does.
        beyond = types.Float((f2 - opaque(types, middle**2)) * opaque(types, steepness / middle))
        return (1 - dr.erf(beyond / (1 + dr.sqrt(types.Float(f2 * opaque(types, middle**-2)))))) / 2


def tapers(problem: Problem) -> list[Taper]:
    """Tapers that end before grazing incidence."""
    size = problem.radius + problem.outermost
    found = [Taper.of(problem, share * size) for share in FADES]
    return [taper for taper in found if taper.sine < TAPER_END_SINE]
