"""Eyes of animals, from published measurements. The docstring of each function states the sources.

compound_eyes  honeybee, fruit_fly, blowfly, dragonfly, megalopta: an AppositionEye; cirolana: an Eye with one receptor
camera_eyes    human, mouse, eagle, goldfish, jumping_spider: an Eye with a patch of retina; goldfish_lens: a BallLens
"""

from optics.animals.camera_eyes import eagle, goldfish, goldfish_lens, human, jumping_spider, mouse
from optics.animals.compound_eyes import COMPOUND, blowfly, cirolana, dragonfly, fruit_fly, honeybee, megalopta

__all__ = [
    "COMPOUND",
    "blowfly",
    "cirolana",
    "dragonfly",
    "eagle",
    "fruit_fly",
    "goldfish",
    "goldfish_lens",
    "honeybee",
    "human",
    "jumping_spider",
    "megalopta",
    "mouse",
]
