"""Checks of settings of eyes: of names, and of values that depend on each other."""

from __future__ import annotations

import math

from evolve.config.checks import ConfigError
from evolve.config.settings import WiringConfig
from evolve.genome.eye_config import VERTICAL_FOVS, EyeConfig
from evolve.genome.genes import INHERITED
from optics.spectra.receptor_dynamics import ADAPTATIONS, LEAST_EVENT, MOTION
from optics.spectra.receptors import RECEPTORS

# IN_TIME: settings of receptors with memory. NEEDED: settings that have an effect only with another setting.
IN_TIME = ("latency_ms", "adaptation", "adaptation_ms", "event_threshold", "motion_detectors", "motion_ms", "frames")
NEEDED = {"adaptation_ms": "adaptation", "motion_ms": "motion_detectors"}
# Settings of camera eyes, which compound eyes do not have.
OF_CAMERAS = (
    *("sensor_width", "relief_height", "relief_points", "relief_symmetric", "pupil_turned", "square", "vertical_fov"),
    *("receptor_pitch", "rhabdoms", "rhabdom_length", "head_radius", "receptor_width", "temporal_order"),
)
GRIDS = ("pool_side", "repeat_side")  # wiring of rows and columns of receptors
RHABDOMS = ("rhabdom_index", "rhabdom_surround", "rhabdom_length", "rhabdom_absorption")
# Limits of the numerical aperture of rhabdoms. A fly's rhabdom has 0.25. A rhabdom below the lower limit guides almost
# no light, and one above the upper limit has hundreds of modes.
LEAST_STEP, MOST_STEP = 0.2, 0.5
# [lx s] smallest allowed exposure. With this exposure, a receptor that sees a white surface through a pupil with
# relative aperture 1 absorbs some 30 photons. For fewer photons, the approximation of shot noise fails.
LEAST_EXPOSURE = 2e-4


def check_eye(eye: EyeConfig) -> None:
    """Check the settings of eyes: names, light, compound eyes, rhabdoms and receptors with memory.

    Raises:
        ConfigError: a name is unknown, settings contradict each other, or a setting without effect does not have its
            default.
    """
    names = {"receptors": (*RECEPTORS, INHERITED), "vertical_fov": VERTICAL_FOVS}
    for name, known in {**names, "adaptation": ADAPTATIONS, "motion_detectors": MOTION}.items():
        if (given := getattr(eye, name)) not in known:
            raise ConfigError(f"eye.{name} = {given!r}: must be one of {', '.join(known)}", f"eye.{name}")
    _check_light(eye)
    _check_compound(eye)
    _check_rhabdoms(eye)
    _check_time(eye)


def _check_light(eye: EyeConfig) -> None:
    """Check that the light is strong enough, and that the integration time is changed only if there is shot noise.

    Raises:
        ConfigError: one of these conditions is not met.
    """
    light, default = eye.illuminance, EyeConfig.integration_time
    if 0 < light * eye.integration_time < LEAST_EXPOSURE:
        raise ConfigError(
            f"eye.illuminance = {light:g}, eye.integration_time = {eye.integration_time:g}: too few photons; "
            f"their product must be at least {LEAST_EXPOSURE:g} lx s, or eye.illuminance 0, no shot noise",
            *("eye.illuminance", "eye.integration_time"),
        )
    if light == 0 and eye.integration_time != default:
        raise ConfigError(
            f"eye.integration_time = {eye.integration_time:g}: has no effect without shot noise: set "
            f"eye.illuminance, or leave it at {default:g}",
            *("eye.integration_time", "eye.illuminance"),
        )


def _check_compound(eye: EyeConfig) -> None:
    """Check that settings suit the kind of eyes, compound or camera eyes, and that compound eyes have optics.

    For camera eyes, `eye.facet_area` must have its default. For compound eyes, all settings that only camera eyes use,
    such as `eye.sensor_width`, must have their defaults.

    Raises:
        ConfigError: one of these conditions is not met.
    """
    default = EyeConfig()
    if not eye.compound and eye.facet_area != default.facet_area:
        raise ConfigError(
            "eye.facet_area: is for compound eyes: set eye.compound = true", "eye.facet_area", "eye.compound"
        )
    for name in OF_CAMERAS if eye.compound else ():
        if getattr(eye, name) != getattr(default, name):
            raise ConfigError(
                f"eye.{name}: is for camera eyes: leave it unchanged, or set eye.compound = false",
                *(f"eye.{name}", "eye.compound"),
            )
    if eye.compound and not eye.optics:
        raise ConfigError("eye.compound = true: facets are optics; set eye.optics = true", "eye.compound", "eye.optics")


def check_wiring(eye: EyeConfig, wiring: WiringConfig) -> None:
    """Check that `pool_side` and `repeat_side`, settings of the wiring, are 0 for compound eyes.

    These settings need receptors in rows and columns.

    Raises:
        ConfigError: one of these settings is not 0.
    """
    for name in GRIDS if eye.compound else ():
        if getattr(wiring, name):
            raise ConfigError(
                f"wiring.{name} = {getattr(wiring, name)}: must be 0 for compound eyes: ommatidia have no rows and "
                "columns",
                *(f"wiring.{name}", "eye.compound"),
            )


def _check_rhabdoms(eye: EyeConfig) -> None:
    """Check that eyes with rhabdoms have optics, and that the numerical aperture of rhabdoms is plausible.

    Also check that settings of rhabdoms are changed only if they have an effect.

    Raises:
        ConfigError: one of these conditions is not met.
    """
    default = EyeConfig()
    for name in RHABDOMS if not (eye.rhabdoms or eye.compound) else ():
        if getattr(eye, name) != getattr(default, name):
            raise ConfigError(f"eye.{name}: is for rhabdoms: set eye.rhabdoms = true", f"eye.{name}", "eye.rhabdoms")
    if eye.rhabdoms and not eye.optics:
        raise ConfigError(
            "eye.rhabdoms = true: needs the waves of a pupil; eye.optics = false gives none",
            "eye.rhabdoms",
            "eye.optics",
        )
    if eye.rhabdom_length == 0 and not eye.compound and eye.rhabdom_absorption != default.rhabdom_absorption:
        raise ConfigError(
            f"eye.rhabdom_absorption = {eye.rhabdom_absorption:g}: needs a length: set eye.rhabdom_length",
            *("eye.rhabdom_absorption", "eye.rhabdom_length"),
        )
    step = math.sqrt(max(eye.rhabdom_index**2 - eye.rhabdom_surround**2, 0.0))
    if not LEAST_STEP <= step <= MOST_STEP:
        raise ConfigError(
            f"eye.rhabdom_index = {eye.rhabdom_index:g}, eye.rhabdom_surround = {eye.rhabdom_surround:g}: the root "
            f"of the difference of their squares is {step:.3g}; must lie in [{LEAST_STEP:g}, {MOST_STEP:g}]",
            *("eye.rhabdom_index", "eye.rhabdom_surround"),
        )


def _check_time(eye: EyeConfig) -> None:
    """Check the settings of receptors with memory, which also respond to past light.

    Settings without effect must have their defaults. The threshold for events, which are changes of a receptor's
    signal, must be 0 or large enough. If it is above 0, receptors must not adapt.

    Raises:
        ConfigError: one of these conditions is not met.
    """
    default = EyeConfig()
    changed = [name for name in IN_TIME if getattr(eye, name) != getattr(default, name)]
    if changed and eye.temporal_order == 0:
        raise ConfigError(
            f"eye.{changed[0]}: is for receptors with memory: set eye.temporal_order = 1 or 2",
            *(f"eye.{changed[0]}", "eye.temporal_order"),
        )
    for name in changed:
        if (other := NEEDED.get(name)) is not None and getattr(eye, other) == "none":
            raise ConfigError(f"eye.{name}: has no effect with eye.{other} = none", f"eye.{name}", f"eye.{other}")
    if 0 < eye.event_threshold < LEAST_EVENT:
        raise ConfigError(
            f"eye.event_threshold = {eye.event_threshold:g}: must be 0, or at least {LEAST_EVENT:g}",
            "eye.event_threshold",
        )
    if eye.event_threshold > 0 and eye.adaptation != "none":
        raise ConfigError(
            f"eye.event_threshold = {eye.event_threshold:g}: must be 0 with eye.adaptation = {eye.adaptation}",
            *("eye.event_threshold", "eye.adaptation"),
        )
