"""Worker endurance: memory and open files over many candidates

Do the memory and the open files of a worker stay constant over many candidates? Yes: over 300 candidates, memory in the
last quarter is 1.00 times the memory in the second quarter, and the ratio of open files is 1.00.

**Method.** One worker evaluates many real candidates one after another, as in a run of a week. The candidates are drawn
from the whole genome, so that eyes, kernels and brains differ between them. Each candidate is trained for a few steps
and evaluated. After each candidate, the worker's resident memory and its open files are read from the system.

**Table.** Candidates differ in size, so only the trend matters. The trend is the median over the last quarter of the
candidates, relative to the median over the second quarter. (During the first quarter, libraries are still being loaded
and kernels compiled.) A candidate fails if the PSF of its eye would need too many samples or too much time.

**Bounds.** Memory in the last quarter is at most 1.25 times that in the second, and the number of open files does not
grow.

**Limits.** Memory may grow slightly because Dr.Jit caches compiled kernels. There is one kernel for each shape of eye
(number of eyes and receptors).

Measurements are stored (`docs/validation/data/worker_endurance.csv`). The page is written from the stored measurements.

    python -m validation.evolve.worker_endurance [--candidates N] [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import csv
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from evolve.config.assemble import assemble
from evolve.config.run_config import RunConfig
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.search.job import Job
from evolve.search.local_executor import LocalExecutor
from evolve.search.worker import evaluate_candidate, prepare_device
from validation.pages.page import Page, parser
from validation.pages.tables import write_table
from validation.pages.work_precision_chart import OURS, OURS_TOO

STORED = Path("docs/validation/data/worker_endurance.csv")
SETTINGS = (
    "learning.total_steps=128",
    "learning.n_envs=8",
    "learning.n_steps=16",
    "learning.batch_size=64",
    "learning.n_epochs=1",
    "learning.eval_interval=128",
    "evaluation.episodes=2",
    "eye.rays_per_receptor=1",
    # Covers all kinds of animals: the preset's own genome is narrower.
    *("genome.placement_range_deg.low=0", "genome.placement_range_deg.high=180"),
    *("genome.fov_deg.low=1", "genome.fov_deg.high=100"),
    *("genome.resolution.low=1", "genome.resolution.high=16"),
    *("genome.relative_aperture.low=0.1", "genome.relative_aperture.high=1"),
    *("genome.refractive_index.low=1", "genome.refractive_index.high=2"),
    *("genome.doe.open=true", "genome.memory_frames.open=true", "genome.memory_frames.high=5"),
    *("genome.neurons.open=true", "genome.neurons.low=16", "genome.neurons.high=128"),
)
MOST_GROWTH = 1.25  # ratio of memory between the last quarter and the second
MB = 1e6


@dataclass(frozen=True)
class Row:
    """The worker after a candidate.

    memory: resident memory [bytes].
    files: number of open files.
    failure: failure of the candidate, or empty.
    """

    candidate: int
    memory: int
    files: int
    failure: str


def jobs(config: RunConfig, count: int, folder: Path) -> Iterator[Job]:
    """Yield jobs with animals drawn from the whole genome."""
    genotype, rng = Genotype(config.genome), np.random.default_rng(0)
    for identity in range(count):
        animal = develop(rng.random(genotype.dimension), config)
        yield Job(identity, animal, config, 1000 + identity, folder / f"{identity:06d}.safetensors")


def measured(count: int) -> list[Row]:
    """Return a worker's memory and open files after each candidate."""
    config, rows = assemble("detection", "quick", assignments=SETTINGS), []
    with tempfile.TemporaryDirectory() as folder, LocalExecutor(evaluate_candidate, 1, prepare_device) as executor:
        for job, outcome in executor.run(list(jobs(config, count, Path(folder)))):
            [worker] = executor._workers
            memory, files = usage(worker.process.pid)
            rows.append(Row(job.id, memory, files, outcome.failure or ""))
            print(f"{job.id:>5}{memory / MB:>9.0f} MB{files:>5} files  {rows[-1].failure}", flush=True)
    return rows


def usage(pid: int) -> tuple[int, int]:
    """Return the resident memory [bytes] and number of open files of a process, from Linux's /proc."""
    status = Path(f"/proc/{pid}/statm").read_text().split()
    return int(status[1]) * os.sysconf("SC_PAGE_SIZE"), len(os.listdir(f"/proc/{pid}/fd"))


def stored() -> list[Row]:
    """Return the latest stored measurements."""
    with STORED.open(encoding="utf-8", newline="") as file:
        return [
            Row(int(row["candidate"]), int(row["memory"]), int(row["files"]), row["failure"])
            for row in csv.DictReader(file)
        ]


def quarters(values: Sequence[int]) -> list[float]:
    """Return the medians of the four quarters."""
    return [float(np.median(part)) for part in np.array_split(np.asarray(values), 4)]


def table(rows: Sequence[Row]) -> str:
    memory, files = (quarters([getattr(row, name) for row in rows]) for name in ("memory", "files"))
    lines = [f"{len(rows)} candidates, {sum(bool(row.failure) for row in rows)} of which failed"]
    lines.append(f"{'quarter':<12}{'memory, median [MB]':>22}{'open files, median':>22}")
    for number, (taken, opened) in enumerate(zip(memory, files, strict=True), start=1):
        lines.append(f"{number:<12}{taken / MB:>22.0f}{opened:>22.0f}")
    lines.append(f"last / second: {memory[3] / memory[1]:.2f} of memory, {files[3] / files[1]:.2f} of files")
    return "\n".join(lines)


def broken(rows: Sequence[Row]) -> list[str]:
    """Return the descriptions of the bounds that do not hold."""
    memory, files = (quarters([getattr(row, name) for row in rows]) for name in ("memory", "files"))
    found = []
    if memory[3] > MOST_GROWTH * memory[1]:
        found.append(f"memory grew {memory[3] / memory[1]:.2f} times: must be at most {MOST_GROWTH}")
    if files[3] > files[1]:
        found.append(f"{files[3]:.0f} files are open at the end: must be {files[1]:.0f}, as in the beginning")
    return found


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw memory and files over candidates."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 3), layout="constrained")
    memory, files = figure.subplots(1, 2)
    memory.plot([row.memory / MB for row in rows], color=OURS)
    files.plot([row.files for row in rows], color=OURS_TOO)
    memory.set(xlabel="candidate", ylabel="memory [MB]", ylim=(0, None))
    files.set(xlabel="candidate", ylabel="open files", ylim=(0, None))
    figure.savefig(path, dpi=150)


def main(arguments: Sequence[str] | None = None) -> int:
    options_of = parser(__doc__ or "")
    options_of.add_argument("--candidates", type=int, default=0, help="number of candidates for a new measurement")
    options = options_of.parse_args(arguments)
    if options.candidates:
        write_table(STORED, [asdict(row) for row in measured(options.candidates)])
    rows = stored()
    return Page("worker_endurance", __doc__ or "", table(rows), broken(rows)).publish(
        options, lambda path: draw(rows, path)
    )


if __name__ == "__main__":
    sys.exit(main())
