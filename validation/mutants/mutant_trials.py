"""Trials of mutants with the nearest tests, in a copy of the tree that is restored after each trial."""

from __future__ import annotations

import ast
import contextlib
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from validation.mutants.mutant_sites import Site

__all__ = ["Copy", "Trial", "nearest_tests"]

PATIENCE = 4.0  # multiple of the duration without mutation after which a mutant counts as hanging
GRACE_S = 60.0  # added to it, because starts and compilations take longer on a busy machine
BUDGET_S = 20.0  # for the tests of each file; the fastest come first
MEASURED_S = 60.0  # limit on measuring the tests of a file; tests not measured by then are never used
NO_TEST = 5  # pytest's exit code
DATA_BYTES = 6 * 2**30  # memory limit of a mutant


@dataclass(frozen=True)
class Trial:
    """Outcome of a mutant.

    verdict: "killed" or "survived".
    by: the test that failed, "time limit" or "crash".
    """

    verdict: str
    by: str
    seconds: float


def nearest_tests(root: Path, path: str) -> list[str]:
    """Return the test files of a module, relative to the tree. The docstring of their folder lists them."""
    package, *folders, name = Path(path).with_suffix("").parts
    if not folders:
        own = f"tests/{package}/test_{name}.py"
        return [own] if (root / own).is_file() else []
    here = root / "tests" / package / folders[0]
    module = ".".join([*folders[1:], name])
    text = ast.get_docstring(ast.parse((here / "__init__.py").read_text())) or ""
    covered = dict(line.split(": ", 1) for line in text.split("\n")[1:] if ": " in line)
    places = (here, here.parent, root / "tests")
    files = [next(place / file for place in places if (place / file).is_file()) for file in covered[module].split(", ")]
    return [str(file.relative_to(root)) for file in files]


@dataclass
class Copy:
    """A copy of a tree in `folder`, in which mutants are tried one after another.

    times: seconds of each test that passes without mutation, {test file: {test: seconds}}.
    versions: hashes of those files.
    """

    folder: Path
    times: dict[str, dict[str, float]] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    _stamps: int = 0

    @classmethod
    def from_root(cls, root: Path, folder: Path) -> Copy:
        """Copy the files that git tracks, and new ones."""
        listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        names = subprocess.run(listed, cwd=root, capture_output=True, check=True).stdout.decode().split("\0")
        for name in filter(None, names):
            if (root / name).is_file():
                target = folder / "tree" / name
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(root / name, target)
        copy, known = cls(folder), folder / "known.json"
        if known.is_file():
            vars(copy).update(json.loads(known.read_text()))
        return copy

    @property
    def tree(self) -> Path:
        return self.folder / "tree"

    def measure(self, files: list[str]) -> None:
        """Measure the tests of files that are new or have changed, without mutation; failing tests are omitted."""
        for file in files:
            version = hashlib.sha256((self.tree / file).read_bytes()).hexdigest()
            if self.versions.get(file) != version:
                report, _ = self._pytest([file], None, limit=1200.0)
                green = {test: took for test, took in report["took"].items() if test not in report["failed"]}
                self.times[file] = {**self.times.get(file, {}), **green}
                self.versions[file] = version
                (self.folder / "known.json").write_text(json.dumps({"times": self.times, "versions": self.versions}))

    def tried(self, site: Site, files: list[str]) -> Trial:
        """Run the nearest tests with the mistake in place."""
        self.measure(files)
        target = self.tree / site.path
        source, began = target.read_bytes(), time.perf_counter()
        try:
            self._write(target, site.applied(source))
            times = {test: took for file in files for test, took in self.times[file].items()}
            limit = GRACE_S + PATIENCE * min(len(files) * BUDGET_S, sum(times.values()))
            report, code = self._pytest(files, times, limit)
        finally:
            self._write(target, source)
        if code is None:
            verdict, by = "killed", "time limit"
        elif report["failed"]:
            verdict, by = "killed", report["failed"][0]
        else:
            verdict, by = ("survived", "") if code in (0, NO_TEST) else ("killed", "crash")
        return Trial(verdict, by, time.perf_counter() - began)

    def _write(self, target: Path, content: bytes) -> None:
        """Write a file with a unique time, because Python recognises compiled files by time and size of the source."""
        self._stamps += 1
        target.write_bytes(content)
        stamp = int(time.time()) - 1_000_000 + self._stamps
        os.utime(target, (stamp, stamp))

    def _pytest(
        self, files: list[str], times: dict[str, float] | None, limit: float
    ) -> tuple[dict[str, Any], int | None]:
        """Run the tests in `times` up to the first failure, and return their report and the exit code.

        With times=None all tests run and are measured. The code is None if the run was ended at its limit.
        """
        asked, report = self.folder / "asked.json", self.folder / "report.json"
        report.unlink(missing_ok=True)
        seconds = MEASURED_S if times is None else BUDGET_S
        measured = list(self.times.get(files[0], {})) if times is None else []
        content = {"times": times, "measured": measured, "seconds": seconds, "report": str(report)}
        asked.write_text(json.dumps(content))
        shutil.rmtree(self.folder / "cache", ignore_errors=True)  # caches of one mutant must not affect the next
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "validation.mutants.mutant_plugin",
            "-p",
            "no:cacheprovider",
        ]
        tree = {
            "PYTHONPATH": f"{self.tree}{os.pathsep}{os.environ.get('PYTHONPATH', '')}",
            "MUTANTS": str(asked),
            "XDG_CACHE_HOME": str(self.folder / "cache"),
        }
        child = subprocess.Popen(
            [*command, *([] if times is None else ["-x"]), *files],
            cwd=self.tree,
            env={**os.environ, **tree},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            preexec_fn=_limit_memory,
        )
        try:
            code = child.wait(limit)
        except subprocess.TimeoutExpired:
            code = None
        finally:
            _end(child)
        found = json.loads(report.read_text()) if report.is_file() else {"took": {}, "failed": []}
        return found, code


def _limit_memory() -> None:
    """Limit the memory of a child process, because a mutant may request all of it."""
    import resource

    resource.setrlimit(resource.RLIMIT_DATA, (DATA_BYTES, DATA_BYTES))


def _end(child: subprocess.Popen[bytes]) -> None:
    """Kill a child and the processes that it started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child.pid, signal.SIGKILL)
    child.wait()
