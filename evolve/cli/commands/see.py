"""`evolve see`: a photograph seen through an animal's eye."""

from __future__ import annotations

from argparse import Namespace

from evolve.cli.waiting import Waiting
from evolve.config.run_config import ConfigError
from evolve.runs.output import say
from sim.pictures.photograph import read_depth, read_photograph, see_photograph

__all__ = ["through_eye"]


def through_eye(arguments: Namespace) -> int:
    """Write a PNG with the photograph and the animal's view, and an EXR with the signals. Print their paths."""
    animal, said = arguments.animal, f"signals of the receptors of a {arguments.animal}"
    try:
        photograph = read_photograph(arguments.photograph)
        depth = None if arguments.depth is None else read_depth(arguments.depth)
        with Waiting(1).of_one_step(said) as wait:
            mosaic = see_photograph(
                photograph, animal, arguments.width_deg, arguments.uv, depth, lambda share: wait.within(said, share)
            )
    except ValueError as error:
        raise ConfigError(str(error)) from None
    arguments.out.mkdir(parents=True, exist_ok=True)
    image, signals = (arguments.out / f"{arguments.photograph.stem}.{animal}.{kind}" for kind in ("png", "exr"))
    mosaic.write_png(image, photograph)
    mosaic.write_exr(signals)
    say(f"{image}\n{signals}")
    return 0
