"""CPU time of the first PSF of a process, compared with `import numpy, scipy`.

    python -m validation.benchmarks.first_psf [rounds]

The script prints medians of the CPU times of separate processes, which take turns. Python's byte code and Dr.Jit's
kernels are cached from earlier processes, as they are for a user.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys

import numpy as np

ROUNDS = 9
PICTURE = "import optics; optics.psf(optics.Pupil(25e-6, thin_lens_focal_length=240e-6), shape=(65, 65)).psf"
DRJIT = "import numpy, drjit, drjit.llvm.ad"
PROGRAMS = {
    "import numpy, scipy": "import numpy, scipy",
    "import numpy": "import numpy",
    "with Dr.Jit and LLVM": DRJIT,
    "with optics' modules": f"{DRJIT}; from optics import Pupil, psf",
    "the first PSF": PICTURE,
}


def milliseconds(program: str) -> float:
    """Return the CPU time [ms] of a process."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", program], env=environment, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return 1e3 * (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def main(arguments: list[str]) -> None:
    """Print a row for each program."""
    milliseconds(PICTURE)
    rounds = int(arguments[0]) if arguments else ROUNDS
    spent = [[milliseconds(program) for program in PROGRAMS.values()] for _ in range(rounds)]
    medians = np.median(spent, axis=0)
    print("| | CPU time [ms] | relative to the first |\n|---|---|---|")
    for name, median in zip(PROGRAMS, medians, strict=True):
        print(f"| {name} | {median:.0f} | {median / medians[0]:.2f} |")


if __name__ == "__main__":
    main(sys.argv[1:])
