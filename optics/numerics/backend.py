"""The LLVM library with which Dr.Jit compiles: search, test in a child process, and selection.

Dr.Jit loads LLVM as a shared library. If the library is too old, Dr.Jit raises an exception. Some versions (15 and 16
with Dr.Jit 1.5) abort the whole process when ``drjit.maximum`` is first computed. Exception handlers cannot prevent
this abort. A child process therefore tests the library. The verdicts "good" and "aborts" are cached for the file and
the versions of Dr.Jit and Python.
"""

from __future__ import annotations

import glob
import json
import os
import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

__all__ = ["BackendError", "Llvm", "candidates", "find", "prove", "require"]

Verdict = Literal["good", "missing", "too old", "aborts", "broken"]

VARIABLE = "DRJIT_LIBLLVM_PATH"
REMEDY = (
    "install LLVM 17 or newer (Debian and Ubuntu: apt-get install libllvm19 libatomic1; "
    f"Fedora: dnf install llvm-libs libatomic; macOS: brew install llvm), or point {VARIABLE} at libLLVM.so"
)
# LLVM 15 and 16 fail at the maximum and minimum of floats. The version is printed last, to show that the whole probe
# ran.
PROBE = """
import drjit as dr
from drjit.llvm import Float
x = dr.arange(Float, 8)
y = dr.sum(dr.clip(dr.minimum(dr.maximum(dr.sin(x), 0), .5), 0, 1))
assert 0 < y[0] < 8
print("proved", ".".join(map(str, dr.detail.llvm_version())))
"""
LIBRARY_PATTERNS = (
    os.path.join(sys.prefix, "lib", "llvm", "**", "libLLVM*.so*"),  # unpacked into the virtual environment
    "/usr/lib/*-linux-gnu*/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
    "/usr/local/opt/llvm*/lib/libLLVM*.dylib",
)


class BackendError(RuntimeError):
    """Dr.Jit cannot compute: no usable LLVM library, no GPU, or an array on a device that is not selected.

    An invalid value of RHABDOM_DEVICE also raises it.

    The message is one line with the remedy.
    """


@dataclass(frozen=True)
class Llvm:
    """Result of the test of one LLVM library in a child process."""

    path: str
    verdict: Verdict
    version: str = ""
    detail: str = ""

    @property
    def good(self) -> bool:
        return self.verdict == "good"


def candidates() -> Iterator[str]:
    """Yield the LLVM libraries to try: the one that the user named, or else all that are found, newest first."""
    named = os.environ.get(VARIABLE)
    if named:
        yield named
        return
    found = {os.path.realpath(path) for pattern in LIBRARY_PATTERNS for path in glob.glob(pattern, recursive=True)}
    yield from sorted(found, key=_version_in_name, reverse=True)
    if not found:
        from ctypes import util

        if name := util.find_library("LLVM"):
            yield name


def _version_in_name(path: str) -> tuple[int, ...]:
    """Return the version in the name of an LLVM library, such as (19, 1) for libLLVM.so.19.1.

    It is (15,) for libLLVM-15.so.1. If a number follows "libLLVM-", as here, the number at the end is the ABI number,
    not the version.
    """
    match = re.search(r"libLLVM(?:-(\d+(?:\.\d+)*))?\.(?:so|dylib)(?:\.(\d+(?:\.\d+)*))?", os.path.basename(path))
    digits = (match.group(1) or match.group(2) or "0") if match else "0"
    return tuple(int(part) for part in digits.split("."))


def prove(path: str) -> Llvm:
    """Test Dr.Jit with this LLVM library in a child process, which takes 0.1 to 0.2 s."""
    if os.sep in path and not os.path.exists(path):
        return Llvm(path, "missing", detail="no such file")
    import subprocess  # imported here, because it is needed only if the verdict is not cached

    environment = {**os.environ, VARIABLE: path}
    try:
        child = subprocess.run(
            [sys.executable, "-c", PROBE],
            env=environment,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Llvm(path, "broken", detail="no answer in 60 s")
    if child.returncode == 0 and (match := re.search(r"^proved (\S+)$", child.stdout, re.MULTILINE)):
        return Llvm(path, "good", match.group(1))
    if child.returncode < 0:
        return Llvm(path, "aborts", detail=f"the process died with signal {-child.returncode}")
    if "backend is inactive" in child.stderr:
        return Llvm(path, "too old", detail="Dr.Jit refuses it")
    lines = child.stderr.strip().splitlines() or ["no message"]
    # A library on which Dr.Jit itself depends is missing, such as libatomic.
    missing = [line for line in lines if "cannot open shared object file" in line]
    return Llvm(path, "broken", detail=(missing or lines)[-1])


def _cache_file() -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(base) / "rhabdom" / "llvm.json"


def _cache_key(path: str) -> str:
    """Return the key under which the test result of the LLVM library at `path` is cached.

    The result depends on the file and on the versions of Dr.Jit and Python, so the key contains them.
    """
    stat = os.stat(path) if os.path.exists(path) else None
    size, modified = (stat.st_size, stat.st_mtime_ns) if stat else (0, 0)
    return f"{path}|{size}|{modified}|drjit {_drjit_version()}|python {sys.version_info[:2]}"


def _drjit_version() -> str:
    """Return Dr.Jit's version from the name of its dist-info folder.

    importlib.metadata is imported only if there is not exactly one such folder, because the import takes as long as
    the computation of a PSF.
    """
    found = find_spec("drjit")
    if found is not None and found.origin is not None:
        beside = os.listdir(os.path.dirname(os.path.dirname(found.origin)))
        versions = [name[6:-10] for name in beside if name.startswith("drjit-") and name.endswith(".dist-info")]
        if len(versions) == 1:
            return versions[0]
    from importlib import metadata

    return metadata.version("drjit")


def _prove_cached(path: str) -> Llvm:
    known = _read_cache()
    key = _cache_key(path)
    try:
        return Llvm(**known[key])
    except (KeyError, TypeError):
        result = prove(path)
    # Other verdicts are not cached, because the user may repair the cause without changing the file.
    if result.verdict in ("good", "aborts"):
        _write_cache({**known, key: asdict(result)})
    return result


def _read_cache() -> dict[str, Any]:
    try:
        known = json.loads(_cache_file().read_text())
    except (OSError, ValueError):
        return {}
    return known if isinstance(known, dict) else {}


def _write_cache(content: dict[str, Any]) -> None:
    """Write the cache. A failure is ignored, because it only makes every start 0.2 s slower."""
    cache = _cache_file()
    try:
        cache.parent.mkdir(parents=True, exist_ok=True)
        temporary = cache.with_suffix(f".{os.getpid()}.tmp")
        temporary.write_text(json.dumps(content, indent=1))
        temporary.replace(cache)
    except OSError:
        return


def find(paths: Iterable[str] | None = None, cached: bool = True) -> tuple[Llvm | None, list[Llvm]]:
    """Return the first usable LLVM library among `paths` (default: `candidates()`), and all test results up to it.

    The library is None if none is usable.

    cached: True to use test results of former processes.
    """
    tried: list[Llvm] = []
    for path in candidates() if paths is None else paths:
        tried.append(_prove_cached(path) if cached else prove(path))
        if tried[-1].good:
            return tried[-1], tried
    return None, tried


@lru_cache(maxsize=1)
def require() -> Llvm:
    """Make sure that Dr.Jit can use LLVM in this process. Call this function before any use of Dr.Jit.

    Sets ``DRJIT_LIBLLVM_PATH`` to the first usable library, and returns the result of that library's test.

    Raises:
        BackendError: no library is usable. The message lists the tested libraries and states the remedy.
    """
    chosen, tried = find()
    if chosen is None:
        seen = "; ".join(f"{llvm.path}: {llvm.verdict} ({llvm.detail})" for llvm in tried) or "no libLLVM found"
        raise BackendError(f"Dr.Jit has no usable LLVM library: {seen}. Remedy: {REMEDY}")
    os.environ[VARIABLE] = chosen.path
    return chosen
