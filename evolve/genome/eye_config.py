"""Settings shared by all eyes of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from evolve.genome.genes import FACETS, RELIEF_POINTS, RHABDOM, TIME_CONSTANT, VERTICAL, Gene, gene_table
from evolve.genome.interval import Interval

__all__ = ["AUTO", "VERTICAL_FOVS", "EyeConfig", "setting"]

VERTICAL_FOVS = ("receptors", "horizontal", "gene")  # valid values of `eye.vertical_fov`
AUTO = "auto"  # value of a setting whose number is chosen automatically


def setting(default: Any, valid: Interval | None, meaning: str) -> Any:
    """Return a dataclass field whose metadata contain the valid range and the meaning of the setting.

    valid: valid range of a number; None if all numbers are valid, or the value is not a number
    """
    return field(default=default, metadata={"valid": valid, "meaning": meaning})


@dataclass(frozen=True)
class EyeConfig:
    """Settings shared by all eyes of a run. `RunConfig` checks the values.

    `evolve config schema` prints the range, the default and the meaning of each field.
    """

    optics: bool = setting(True, None, "see through the pupil and its relief; if false, through a perfect lens")
    sensor_width: float = setting(
        200e-6, Interval(1e-6, 1e-2), "width of the retina [m], unless receptor_pitch determines it"
    )
    noise_sigma: float = setting(0.01, Interval(0, 10), "standard deviation of a receptor's noise, in signals of white")
    illuminance: float = setting(
        0.0, Interval(0, 1e6), "illuminance of the scene [lx], which determines shot noise; 0: no shot noise"
    )
    integration_time: float = setting(
        0.02, Interval(1e-6, 1e3), "time over which a receptor sums photons [s]; used only if illuminance is above 0"
    )
    receptors: str = setting(
        "rgb",
        None,
        "receptor types: rgb, lms or an animal's, such as honeybee; genes: from each animal's spectral genes",
    )
    bands: int = setting(4, Interval(1, 64), "spectral bands")
    relief_height: float = setting(100e-6, Interval(0, 1e-2, open_low=True), "height of the relief at gene value 1 [m]")
    relief_points: int = setting(
        4,
        RELIEF_POINTS,
        "relief genes along one side; 4: a bicubic patch; more: a cubic spline through their heights",
    )
    relief_symmetric: bool = setting(
        False, None, "reliefs are invariant under reflection and rotation by 90 degrees, with an eighth of the genes"
    )
    pupil_turned: bool = setting(
        False, None, "pupils are rotated by 180 degrees about their axes, as in runs of formats 1 and 2"
    )
    rays_per_receptor: float | str = setting(
        AUTO,
        Interval(0, 4096, open_low=True),
        "rays traced per receptor and frame; auto: area sampling, or the fewest rays that the noise allows",
    )
    square: bool = setting(
        False, None, "eyes are square: the gene resolution replaces resolution_height and resolution_width"
    )
    vertical_fov: str = setting(
        VERTICAL_FOVS[0],
        None,
        "an eye's vertical field of view; receptors: that of square receptors; horizontal: equal to the horizontal "
        "field of view; gene: from the gene vertical_fov_deg",
    )
    receptor_pitch: float = setting(
        0.0,
        Interval(0, 1e-4),
        "width of a receptor [m], so that eyes with more receptors are wider; 0: all retinas are sensor_width wide",
    )
    rhabdoms: bool = setting(
        False,
        None,
        "receptors are rhabdoms, which guide light in modes; if false, squares that absorb all incident light",
    )
    rhabdom_index: float = setting(1.363, Interval(1, 2), "refractive index of rhabdoms")
    rhabdom_surround: float = setting(1.340, Interval(1, 2), "refractive index of the medium around rhabdoms")
    rhabdom_length: float = setting(
        0.0,
        Interval(0, 1e-2),
        "length of rhabdoms [m], along which light is absorbed; 0: all guided light is absorbed",
    )
    rhabdom_absorption: float = setting(
        6e3, Interval(0, 1e6, open_low=True), "absorption along rhabdoms [1/m]; used only if rhabdom_length is above 0"
    )
    head_radius: float = setting(
        1e-3, Interval(0, 10, open_low=True), "radius of the head [m]; eyes on it do not overlap"
    )
    receptor_width: float = setting(
        1e-6, Interval(0, 1e-2, open_low=True), "smallest width of a receptor [m]; receptors do not overlap"
    )

    compound: bool = setting(
        False,
        None,
        "eyes are compound eyes: their receptors are ommatidia in a hexagonal lattice, with genes for facets and "
        "rhabdoms instead of the pupil",
    )
    facet_area: float = setting(
        1e-7,
        Interval(1e-10, 1e-2),
        "area of the head on which the facets of all eyes fit [m²]; used only if compound",
    )

    temporal_order: int = setting(
        0,
        Interval(0, 2),
        "low-pass filters in series in a receptor, with the time constant of the gene time_constant_ms; 0: receptors "
        "without memory, which see only the last moment of an action",
    )
    latency_ms: float = setting(0.0, Interval(0, 10_000), "delay of the receptors' responses [ms]")
    adaptation: str = setting(
        "none", None, "gain control by the mean of the signal over adaptation_ms: none, naka_rushton or logarithmic"
    )
    adaptation_ms: float = setting(1000.0, Interval(1, 1e7), "time constant of the mean that controls the gain [ms]")
    event_threshold: float = setting(
        0.0, Interval(0, 100), "change of the logarithm of a receptor's signal that counts as an event; 0: no events"
    )
    motion_detectors: str = setting(
        "none", None, "detectors between neighbours, as further channels: none, hassenstein_reichardt or barlow_levick"
    )
    motion_ms: float = setting(35.0, Interval(0.1, 10_000), "time constant of the motion detectors [ms]")
    frames: int = setting(
        0,
        Interval(0, 1000),
        "frames rendered per action for receptors with memory; 0: the fewest that the noise allows",
    )

    @property
    def genes(self) -> Mapping[str, Gene]:
        """All genes that animals with these eyes can have, by name."""
        present = {
            RHABDOM: self.rhabdoms or self.compound,
            VERTICAL: self.vertical_fov == "gene",
            TIME_CONSTANT: self.temporal_order > 0,
            **dict.fromkeys(FACETS, self.compound),
        }
        optional = frozenset(name for name, has in present.items() if has)
        return gene_table(self.relief_points, self.relief_symmetric, self.square, optional, pupils=not self.compound)
