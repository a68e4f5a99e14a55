"""Other codes for scalar diffraction, each behind one small adapter with a name of its own: `PEER` in each module.

Adapters set a code up the way its documents say, in its own units and conventions. Whatever a code can prepare once
(sampled fields, transfer functions, propagators) is prepared before the clock starts.

work_precision    the proof: error against time of these codes and ours
population_speed  the proof: PSFs per CPU second of whole populations
peer_claims       the proof: what the tests of other codes and textbooks assert
claims            those claims
problem           the cases that every code is given
measure, points   measured points, and the file that keeps those of the peers
goals             what is asked of `optics` beside its peers
rhabdom           ours, on the same cases

Adapters: deeplens, diffractio, diffractsim, hcipy, lightpipes, poppy, prysm, svetlanna, torchoptics, waveprop.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Mapping
from functools import cache
from importlib import import_module, metadata
from types import MappingProxyType

from validation.peers.problem import Peer

__all__ = ["MODULES", "installed"]

MODULES = (
    "deeplens",
    "diffractio",
    "diffractsim",
    "hcipy",
    "lightpipes",
    "poppy",
    "prysm",
    "svetlanna",
    "torchoptics",
    "waveprop",
)


@cache
def installed() -> Mapping[Peer, str]:
    """Those that can be run here, with their versions. One that is there but cannot be imported is named."""
    found = {}
    for module in MODULES:
        peer = import_module(f"validation.peers.{module}").PEER
        try:
            found[peer] = metadata.version(peer.distribution)
            with warnings.catch_warnings(action="ignore"):
                import_module(peer.package)
        except metadata.PackageNotFoundError:
            continue
        except ImportError as problem:
            print(f"{peer.distribution} {found.pop(peer)} cannot be imported: {problem}", file=sys.stderr)
    return MappingProxyType(found)
