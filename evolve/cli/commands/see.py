"""`evolve see`: a photograph seen through an animal's eye."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from evolve.runs.output import say

__all__ = ["add_arguments", "through_eye"]


def add_arguments(command: ArgumentParser) -> None:
    """Add the arguments of `evolve see`."""
    command.add_argument("photograph", type=Path, metavar="FILE", help="opaque colour image, such as a JPEG file")
    command.add_argument("--animal", required=True, metavar="NAME", help="animal, such as honeybee, goldfish or eagle")
    angle = "angle that the width of the photograph covers in the visual field [degrees]"
    command.add_argument("--width-deg", type=float, required=True, metavar="DEG", help=angle)
    ultraviolet = "ultraviolet reflectance of white surfaces, which no photograph contains, 0 to 1 (default: 1)"
    command.add_argument("--uv", type=float, default=1.0, metavar="SHARE", help=ultraviolet)
    command.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="output directory (default: this one)")


def through_eye(arguments: Namespace) -> int:
    """Write a PNG with the photograph and the animal's view, and an EXR with the signals. Print their paths."""
    from evolve.cli.waiting import Waiting
    from evolve.config.run_config import ConfigError
    from sim.pictures.photograph import read_photograph, see_photograph

    animal, said = arguments.animal, f"signals of the receptors of a {arguments.animal}"
    try:
        photograph = read_photograph(arguments.photograph)
        with Waiting(1).of_one_step(said) as wait:
            mosaic = see_photograph(
                photograph, animal, arguments.width_deg, arguments.uv, lambda share: wait.within(said, share)
            )
    except ValueError as error:
        raise ConfigError(str(error)) from None
    arguments.out.mkdir(parents=True, exist_ok=True)
    image, signals = (arguments.out / f"{arguments.photograph.stem}.{animal}.{kind}" for kind in ("png", "exr"))
    mosaic.write_png(image, photograph)
    mosaic.write_exr(signals)
    say(f"{image}\n{signals}")
    return 0
