"""A check, before rendering starts, that the arrays of the rendering fit into memory.

Without this check, the system would kill the process without a message.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path

INDICES = 2**32  # largest number of elements of one Dr.Jit array
RAY_BYTES = 64  # bytes per ray: direction, origin, and the numbers from which they are computed
GIB = 2**30
CGROUPS = Path("/sys/fs/cgroup")
# Files of control groups, version 2 and version 1: limit, usage and statistics. The last entry is the prefix of cached
# files in the statistics.
_GROUPS = (
    ("memory.max", "memory.current", "memory.stat", ""),
    ("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes", "memory/memory.stat", "total_"),
)


@dataclass(frozen=True)
class Demand:
    """The least memory that rendering needs.

    rays_per_receptor: number of rays per receptor
    worlds: number of worlds
    eyes: number of eyes of one agent
    resolution: receptors (height, width) of an eye
    planes: number of values that are stored for every ray: (number of components of light) · (number of depth layers)
    weights: number of weights that each ray has for each receptor: (number of bands) · (number of depth layers); 0
        without a pupil
    """

    rays_per_receptor: float
    worlds: int
    eyes: int
    resolution: tuple[int, int]
    planes: int
    weights: int

    @property
    def rays(self) -> float:
        """Number of rays of one eye."""
        return self.rays_per_receptor * math.prod(self.resolution)

    @property
    def elements(self) -> float:
        """Number of elements in the array that the kernel writes."""
        return self.rays * self.eyes * self.worlds * self.planes

    @property
    def bytes(self) -> float:
        """Number of bytes that rendering needs, at least.

        They hold the array that the rendering kernel writes, the directions and starting points of the rays, and the
        weights with which all rays contribute to one row of receptors.
        """
        return 4 * self.elements + self.rays * (RAY_BYTES * self.eyes + 16 * self.weights * self.resolution[1])


def check_memory(demand: Demand) -> None:
    """Refuse rendering that does not fit into memory.

    Raises:
        ValueError: there is too little memory, or an array would have more than 2³² elements. The message states how
            many rays per receptor fit.
    """
    free = available()
    excess = max(demand.bytes / free, demand.elements / INDICES)
    if excess <= 1:
        return
    height, width = demand.resolution
    most = _rounded_down(demand.rays_per_receptor / excess)
    raise ValueError(
        f"rays_per_receptor = {demand.rays_per_receptor:g}: {demand.worlds} worlds with {demand.eyes} eyes of "
        f"{height} x {width} receptors would take {demand.bytes / GIB:.3g} GiB of memory, {free / GIB:.3g} are free; "
        f"use at most {most:g} rays per receptor, or fewer worlds at once"
    )


def available() -> float:
    """Return the number of bytes that are available without swapping.

    It is the smaller of two numbers: the bytes available on the machine, and the bytes that this process may still use
    under the memory limit of its container. If the system does not report the machine's available bytes, its total
    memory is used. If that is unknown, too, it counts as infinite.
    """
    return min(_of_machine(), _of_container(CGROUPS))


def _of_machine() -> float:
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            name, _, value = line.partition(":")
            if name == "MemAvailable":
                return 1024.0 * int(value.split()[0])
    except OSError:
        pass
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, OSError, ValueError):
        return math.inf


def _of_container(root: Path) -> float:
    """Return how many bytes the memory limits of control groups leave; infinite without limits.

    If a group has reached or exceeded its limit, the result is 1, because the caller divides by it.
    """
    free = math.inf
    for limit, used, statistics, prefix in _GROUPS:
        try:
            left = int((root / limit).read_text("ascii")) - int((root / used).read_text("ascii"))
        except (OSError, ValueError):  # there is no such group, or its limit is "max"
            continue
        free = min(free, max(1.0, left + _of_files(root / statistics, prefix)))
    return free


def _of_files(statistics: Path, prefix: str) -> int:
    """Return the number of bytes that the system uses to cache files, and frees when memory is needed."""
    try:
        lines = [line.split() for line in statistics.read_text("ascii").splitlines()]
        return sum(int(size) for name, size in lines if name in (f"{prefix}active_file", f"{prefix}inactive_file"))
    except (OSError, ValueError):
        return 0


def _rounded_down(value: float) -> float:
    """Round down to two significant digits."""
    digit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.floor(value / digit) * digit
