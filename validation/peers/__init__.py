"""Other codes for scalar diffraction, each behind one small adapter with a name of its own: `PEER` in each module.

Adapters set a code up the way its documents say, in its own units and conventions. Whatever a code can prepare once
(sampled fields, transfer functions, propagators) is prepared before the clock starts.
"""

from __future__ import annotations

from importlib import import_module, metadata

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


def installed() -> dict[Peer, str]:
    """Those that can be run here, with their versions."""
    found = {}
    for module in MODULES:
        peer = import_module(f"validation.peers.{module}").PEER
        try:
            found[peer] = metadata.version(peer.distribution)
        except metadata.PackageNotFoundError:
            continue
    return found
