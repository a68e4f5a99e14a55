"""Adapters to other codes for scalar diffraction: `PEER` in one module per code.

Adapters use a code as its documentation recommends, in its own units and conventions. Sampled fields, transfer
functions and propagators that a code can prepare once are prepared before timing starts.

work_precision    proof: error against time of these codes and ours
population_speed  proof: PSFs per CPU second of whole populations
new_wavefronts    times of single PSFs in that proof
optimisation_costs  proof: CPU times of PSFs with gradients, for the design of pupils
design_cases      pupils of that proof, with a matrix Fourier transform in PyTorch
peer_claims       proof: claims of other codes' tests and of textbooks
claims            those claims
problem           cases for all codes
measure, points   measured points, and the file of the peers' points
goals             goals of `optics` relative to its peers
rhabdom           this package on the same cases

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
    """Return peers that can run here, with their versions. Installed peers that cannot be imported are reported."""
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
