"""Mutants that are always tried: deliberate mistakes that no test detected at first."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from validation.mutants.mutant_sites import Site

__all__ = ["NAMED", "Named"]


@dataclass(frozen=True)
class Named:
    """A mutant in a file: `before`, which occurs once, becomes `after`."""

    path: str
    what: str
    before: str
    after: str

    def site(self, root: Path) -> Site:
        """Return the site of the mutant in its file.

        Raises:
            ValueError: `before` does not occur exactly once.
        """
        source = (root / self.path).read_bytes()
        if source.count(self.before.encode()) != 1:
            raise ValueError(f"{self.path}: {self.before!r} must occur once")
        start = source.index(self.before.encode())
        line = source.count(b"\n", 0, start) + 1
        return Site(
            self.path, line, "named", start, start + len(self.before.encode()), self.before, self.after, self.what
        )


def _mutants(path: str, *changes: tuple[str, str, str]) -> list[Named]:
    return [Named(path, *change) for change in changes]


NAMED = (
    *_mutants(
        "optics/point_spread/spot_check.py",
        (
            "darkness reduces the digits of the check",
            "2 * 10.0 ** (darkness - reference.digits)",
            "2 * 10.0 ** (-reference.digits)",
        ),
        (
            "the direct sum's own error is included",
            "+ rounding + _own_error(problem, reference, darkness)",
            "+ rounding",
        ),
    ),
    *_mutants("optics/eye/kernel_interpolation.py", ("negative differences count", "in (1, -1)))", "in (1, 1)))")),
    *_mutants(
        "optics/point_spread/psf_result.py",
        ("the cutoff depends on the medium", "* index / self.wavelengths\n", "/ self.wavelengths\n"),
    ),
    *_mutants(
        "optics/numerics/backend.py",
        ("libraries that may be repaired are tested again", 'if result.verdict in ("good", "aborts"):', "if True:"),
    ),
    *_mutants(
        "sim/physics/agent_motion.py",
        ("an unstable simulation has no contacts", "contact & ~unstable, unstable", "contact, unstable"),
        ("speeds beyond all actuators", "UNSTABLE_SPEED = 10 * MAX_SPEED", "UNSTABLE_SPEED = 1000 * MAX_SPEED"),
    ),
    *_mutants(
        "sim/render/receptor_noise.py",
        ("shot noise is largest in bright light", "2 * brightest / float(self.photons.min())", "0.0"),
        ("receptors with few photons are the noisiest", "self.photons.min()", "self.photons.max()"),
    ),
    *_mutants(
        "sim/exr/files.py",
        ("missing parts", 'if attributes.get("parts") != str(expected):', "if False:"),
        (
            "an image is synced before it is renamed",
            "            os.fsync(file.fileno())\n",
            "            pass\n",
        ),
        (
            "an incomplete image is removed",
            "        Path(temporary).unlink(missing_ok=True)\n        raise",
            "        raise",
        ),
    ),
    *_mutants(
        "evolve/store/record.py",
        ("a line is synced", "                file.flush()\n                os.fsync(file.fileno())\n", ""),
        (
            "a truncation is synced",
            "(self._whole_bytes)\n                os.fsync(file.fileno())",
            "(self._whole_bytes)",
        ),
    ),
    *_mutants(
        "evolve/store/atomic_files.py",
        ("a file is synced before it is renamed", "            os.fsync(file.fileno())", "            pass"),
        ("its name is synced", "        sync_folder(path.parent)", "        pass"),
        ("an incomplete file is removed", "            neighbour.unlink(missing_ok=True)", "            pass"),
    ),
    *_mutants(
        "evolve/store/directory.py",
        (
            "ties go to the first candidate",
            "(candidate.fitness, -candidate.id)",
            "(candidate.fitness, candidate.id)",
        ),
    ),
    *_mutants("evolve/search/search.py", ("a failure counts as the worst so far", "LOWEST = -1e9", "LOWEST = 0.0")),
    *_mutants(
        "evolve/learning/fitness.py",
        ("every rung has its own seed", "[seed, number] if number else seed", "seed"),
    ),
    *_mutants("evolve/report/markup.py", ("data cannot end a script element", '.replace("<", "\\\\u003c")', "")),
)
