"""Mutants that are always tried: mistakes that nothing noticed when they were made on purpose for the first time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from validation.mutants.mutant_sites import Site

__all__ = ["NAMED", "Named"]


@dataclass(frozen=True)
class Named:
    """In the file, `before`, which is there once, becomes `after`."""

    path: str
    what: str
    before: str
    after: str

    def site(self, root: Path) -> Site:
        """Where it is.

        Raises:
            ValueError: `before` is not there, or more than once.
        """
        source = (root / self.path).read_bytes()
        if source.count(self.before.encode()) != 1:
            raise ValueError(f"{self.path}: {self.before!r} must be there once")
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
            "darkness costs the check digits",
            "2 * 10.0 ** (darkness - reference.digits)",
            "2 * 10.0 ** (-reference.digits)",
        ),
        ("the direct sum's own error is told", " + 2 * 10.0 ** (darkness - reference.digits)", ""),
    ),
    *_mutants("optics/eye/kernel_interpolation.py", ("too dark counts as too bright", "in (1, -1)))", "in (1, 1)))")),
    *_mutants(
        "optics/point_spread/psf_result.py",
        ("the cutoff knows the medium", "* index / self.wavelengths\n", "/ self.wavelengths\n"),
    ),
    *_mutants(
        "optics/numerics/backend.py",
        ("what may be mended is proved again", 'if result.verdict in ("good", "aborts"):', "if True:"),
    ),
    *_mutants(
        "sim/physics/agent_motion.py",
        ("a broken simulation touches nothing", "contact = contact & ~unstable", "pass"),
        ("speeds that no actuator can bring", "UNSTABLE_SPEED = 10 * MAX_SPEED", "UNSTABLE_SPEED = 1000 * MAX_SPEED"),
    ),
    *_mutants(
        "sim/render/receptor_noise.py",
        ("shot noise is largest in bright light", "2 * brightest / float(self.photons.min())", "0.0"),
        ("receptors with few photons are the noisiest", "self.photons.min()", "self.photons.max()"),
    ),
    *_mutants(
        "sim/exr.py",
        ("parts that are missing", 'if attributes.get("parts") != str(expected):', "if False:"),
        (
            "a picture is on the disk before it has its name",
            "            os.fsync(file.fileno())\n",
            "            pass\n",
        ),
        (
            "half a picture is removed",
            "        Path(temporary).unlink(missing_ok=True)\n        raise",
            "        raise",
        ),
    ),
    *_mutants(
        "evolve/store/record.py",
        ("a line is on the disk", "                file.flush()\n                os.fsync(file.fileno())\n", ""),
        (
            "what is cut off is gone from the disk",
            "(self._whole_bytes)\n                os.fsync(file.fileno())",
            "(self._whole_bytes)",
        ),
    ),
    *_mutants(
        "evolve/store/atomic_files.py",
        ("a file is on the disk before it has its name", "            os.fsync(file.fileno())", "            pass"),
        ("its name is on the disk", "        sync_folder(path.parent)", "        pass"),
        ("half a file is removed", "            neighbour.unlink(missing_ok=True)", "            pass"),
    ),
    *_mutants(
        "evolve/store/directory.py",
        (
            "the first of the best is the best",
            "(candidate.fitness, -candidate.id)",
            "(candidate.fitness, candidate.id)",
        ),
    ),
    *_mutants("evolve/search/search.py", ("a failure counts as the worst so far", "LOWEST = -1e9", "LOWEST = 0.0")),
    *_mutants(
        "evolve/learning/fitness.py",
        ("every stage has chance of its own", "[seed, number] if number else seed", "seed"),
    ),
    *_mutants("evolve/report/markup.py", ("data end no script", '.replace("<", "\\\\u003c")', "")),
)
