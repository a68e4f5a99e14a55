"""Check of the installation: versions, LLVM, Mitsuba variants, processor, memory and the cache of light tables."""

from __future__ import annotations

import json
import math
import os
import platform
import subprocess
import sys
from importlib import metadata

from evolve.runs.output import say
from optics.numerics import backend
from optics.numerics.device import device
from rhabdom.importing import namesakes
from sim.render.memory_budget import GIB, available
from sim.tracing.areas.light_store import cache_folder, write_error

__all__ = ["examine", "print_findings", "unsupported"]

PACKAGES = (
    "rhabdom",
    "numpy",
    "scipy",
    "drjit",
    "mitsuba",
    "mujoco",
    "torch",
    "gymnasium",
    "stable-baselines3",
    "safetensors",
    "nevergrad",
    "cma",
    "OpenEXR",
    "matplotlib",
    "pillow",
    "rich",
    "shtab",
    "threadpoolctl",
    "tomli-w",
    "pandas",
)
# Advice from docs/measurements/rendering.md, "On a GPU".
USE_OF_GPU = "renders a thousand worlds two to four times as fast; no gain for PSFs, physics, learning and evolution"
# Program that renders an image with each variant of Mitsuba. It runs in a child process, because importing Mitsuba can
# crash a process if the installation is broken.
RENDER = """
import sys, mitsuba as mi, numpy as np
for name in sys.argv[1:]:
    try:
        mi.set_variant(name)
        film = {"type": "hdrfilm", "width": 2, "height": 2}
        scene = mi.load_dict({"type": "scene", "light": {"type": "constant"}, "integrator": {"type": "direct"},
                              "sensor": {"type": "perspective", "film": film}})
        pixel = np.array(mi.render(scene, spp=1)).mean()
        print(name, "works" if pixel > 0 else "renders black")
    except Exception as error:
        print(name, "fails:", str(error).strip().splitlines()[0])
"""


def unsupported(platform_name: str = sys.platform) -> str | None:
    """Return a message in one line if the operating system is not supported, else None.

    Processes and locks use features of Linux and macOS that Windows lacks.

    platform_name: value of `sys.platform`
    """
    if platform_name in ("linux", "darwin"):
        return None
    return f"{platform_name}: is not supported; must be Linux or macOS (on Windows: in WSL 2, which is Linux)"


def examine() -> dict[str, object]:
    """Examine the installation, and return the findings by name as JSON values.

    python: version of Python
    machine: operating system, architecture and number of cores
    gpu: name of the first NVIDIA GPU, or "none"
    device: device for PSFs, eyes and rays, or the reason why it cannot be used
    free_memory: free memory [bytes]; None if it is unknown
    light_cache: folder of the light tables (tables of the light that walls and floor reflect to each other), and the
        error that prevents writing there (None if there is none)
    packages: version of each package, or "not installed"
    llvm: all LLVM libraries that were tested
    variants: state of each tested variant of Mitsuba
    notes: messages about the operating system, and about files that have the same name as a package of rhabdom, so
        that Python imports them instead of the package
    good: True if all parts that `evolve run` needs work
    """
    chosen, tried = backend.find(cached=False)
    environment = {**os.environ, backend.VARIABLE: chosen.path} if chosen else dict(os.environ)
    wanted = ["scalar_spectral"] + (["llvm_ad_spectral"] if chosen else [])
    gpu = _gpu()
    if gpu:
        wanted.append("cuda_ad_spectral")
    variants = _render(wanted, environment)
    packages = {name: _version(name) for name in PACKAGES}
    works = variants.get("scalar_spectral") == variants.get("llvm_ad_spectral") == "works"
    refused = unsupported()
    return {
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {len(os.sched_getaffinity(0))} cores"
        if hasattr(os, "sched_getaffinity")
        else f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
        "gpu": gpu or "none",
        "device": _device(),
        "free_memory": available() if math.isfinite(available()) else None,
        "light_cache": {"folder": str(cache_folder()), "error": write_error()},
        "packages": packages,
        "llvm": [vars(llvm) for llvm in tried],
        "variants": variants,
        "notes": [*([refused] if refused else []), *namesakes()],
        "good": works
        and refused is None
        and not _device().startswith("refused")
        and "not installed" not in packages.values(),
    }


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"


def _device() -> str:
    """Return the device on which PSFs, eyes and rays are computed, or the reason why it cannot be used."""
    try:
        return device()
    except backend.BackendError as error:
        return f"refused: {error}"


def _gpu() -> str:
    """Return the name of the first NVIDIA GPU, or "" if there is none."""
    try:
        query = ["nvidia-smi", "--query-gpu=name", "--format=csv,noheader"]
        child = subprocess.run(query, capture_output=True, text=True, timeout=20, check=True)
    except (OSError, subprocess.SubprocessError):
        return ""
    return child.stdout.strip().splitlines()[0] if child.stdout.strip() else ""


def _render(variants: list[str], environment: dict[str, str]) -> dict[str, str]:
    command = [sys.executable, "-c", RENDER, *variants]
    child = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, check=False)
    seen = dict(line.split(" ", 1) for line in child.stdout.splitlines() if line.split(" ", 1)[0] in variants)
    last_line = (child.stderr.strip().splitlines() or [f"exit status {child.returncode}"])[-1]
    return {name: seen.get(name, f"fails: {last_line}") for name in variants}


def print_findings(as_json: bool = False) -> int:
    """Print the findings as text, or as JSON if `as_json` is True. Return 0 if `evolve run` can work, else 2."""
    findings = examine()
    if as_json:
        say(json.dumps(findings, indent=2))
    else:
        say("\n".join(_lines(findings)))
    return 0 if findings["good"] else 2


def _lines(findings: dict[str, object]) -> list[str]:
    packages, variants, tried = findings["packages"], findings["variants"], findings["llvm"]
    notes, free, cache = findings["notes"], findings["free_memory"], findings["light_cache"]
    assert free is None or isinstance(free, float)
    assert isinstance(cache, dict)
    assert isinstance(packages, dict)
    assert isinstance(notes, list)
    assert isinstance(variants, dict)
    assert isinstance(tried, list)
    lines = [
        f"{'python':<20}{findings['python']}",
        f"{'machine':<20}{findings['machine']}",
        f"{'gpu':<20}{findings['gpu']} (a GPU {USE_OF_GPU})",
        f"{'device':<20}{findings['device']} for PSFs, eyes and rays; cpu for physics and learning",
        f"{'free memory':<20}{'unknown' if free is None else f'{free / GIB:.3g} GiB'}",
        f"{'light tables':<20}{cache['folder']}: "
        + ("writable" if cache["error"] is None else f"{cache['error']}; every process computes the tables again"),
    ]
    lines += [f"{name:<20}{version}" for name, version in packages.items()]
    for llvm in tried:
        note = (
            f"good, version {llvm['version']}, in use"
            if llvm["verdict"] == "good"
            else f"{llvm['verdict']}: {llvm['detail']}"
        )
        lines.append(f"{'llvm':<20}{llvm['path']}: {note}")
    lines += [f"{'variant':<20}{name}: {state}" for name, state in variants.items()]
    lines += [f"{'note':<20}{note}" for note in notes]
    if not any(llvm["verdict"] == "good" for llvm in tried):
        lines.append(f"remedy: {backend.REMEDY}")
    lines.append("all good" if findings["good"] else "not good: see the lines above")
    return lines
