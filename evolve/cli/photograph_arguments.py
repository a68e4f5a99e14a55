"""Arguments of `evolve see`."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path

__all__ = ["add_photograph"]


def add_photograph(command: ArgumentParser) -> None:
    """Add the photograph's file and the options of `evolve see` to the command's parser."""
    image = "colour image without transparency, such as a JPEG file"
    command.add_argument("photograph", type=Path, metavar="FILE", help=image)
    command.add_argument("--animal", required=True, metavar="NAME", help="animal, such as honeybee, goldfish or eagle")
    angle = "angle that the width of the photograph covers in the visual field [degrees]"
    command.add_argument("--width-deg", type=float, required=True, metavar="DEG", help=angle)
    ultraviolet = "assumed ultraviolet reflectance of white surfaces, 0 to 1; photographs do not record it (default: 1)"
    command.add_argument("--uv", type=float, default=1.0, metavar="FRACTION", help=ultraviolet)
    distance = "distance of the scene [m]: a number, or a .npy file with one number per pixel (default: infinity)"
    command.add_argument("--depth", metavar="METRES", help=distance)
    where = "output directory (default: the current one)"
    command.add_argument("--out", type=Path, default=Path(), metavar="DIR", help=where)
