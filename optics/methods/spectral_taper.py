"""The taper that fades an angular spectrum out before grazing incidence, so that a finite grid can represent it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from optics.methods.problem import Problem
from optics.numerics.autodiff import Array
from optics.numerics.precision import Precision, opaque

__all__ = ["FADES", "TAPER_END_SINE", "Taper", "tapers"]

# Choice: sine at which the taper must end at the latest, because z tan θ has no bound at grazing incidence.
TAPER_END_SINE = 0.9995
# Choice: blurs of the tapers to try, relative to the radius of the pupil plus that of the window.
FADES = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0)


@dataclass(frozen=True)
class Taper:
    """A taper that fades a spectrum out between the frequencies `band` and `band` + `width` [1/m].

    It blurs the field by `blur` [m].

    The taper is an error function of the frequency. Its derivative with respect to the frequency is a Gaussian, and the
    Fourier transform of this Gaussian falls to the allowed error of the amplitude at the distance `blur`. Light that
    the taper removes must therefore land at least this far outside the window.

    sine, tangent: sine and tangent of the angle at which the taper ends.
    """

    band: float
    width: float
    blur: float
    sine: float
    tangent: float

    @classmethod
    def for_problem(cls, problem: Problem, blur: float) -> Taper:
        band, width = problem.band(blur), 2 * math.log(1 / problem.fade_ripple) / (math.pi * blur)
        sine = (band + width) * problem.wavelength
        return cls(band, width, blur, sine, sine / math.sqrt(max(1 - sine * sine, 1e-12)))

    @property
    def end(self) -> float:
        return self.band + self.width

    def fade(self, f2: Array, types: Precision) -> Array:
        """Return the taper: 1 up to the frequency `band` and 0 beyond `end`, to within the ripple.

        The ripple is the allowed error of the amplitude. The taper is (1 - erf(u))/2, where u is -√ln(1/ripple) at
        `band` and √ln(1/ripple) at `end`. At these values, erf(u) differs from -1 and 1 by at most the ripple.

        f2: squared frequencies f², float64.
        """
        import drjit as dr

        steepness = 2 / self.width * math.sqrt(math.pi * self.width * self.blur / 2)
        middle = self.band + self.width / 2
        # With m the middle, f - m is (f² - m²) / (f + m), so a square root of low precision is sufficient for f.
        beyond = types.Float((f2 - opaque(types, middle**2)) * opaque(types, steepness / middle))
        return (1 - dr.erf(beyond / (1 + dr.sqrt(types.Float(f2 * opaque(types, middle**-2)))))) / 2


def tapers(problem: Problem) -> list[Taper]:
    """Return tapers to choose from, each of which fades the angular spectrum out before grazing incidence.

    They are in the order of increasing `Taper.blur`, the distance [m] by which a taper blurs the field.
    """
    size = problem.radius + problem.outermost
    found = [Taper.for_problem(problem, blur * size) for blur in FADES]
    return [taper for taper in found if taper.sine < TAPER_END_SINE]
