"""Searches for a lens by gradient and by CMA-ES, which experiments.lens_search compares."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

import optics
from evolve.config.run_config import SearchConfig
from evolve.genome.genes import GENES
from evolve.search.optimizers import Space, build_optimizer

__all__ = [
    "BOUNDS",
    "METHODS",
    "POPULATION",
    "RADIUS",
    "RELIEF_HEIGHT",
    "SPOTS",
    "WAVELENGTH",
    "Row",
    "best_lens",
    "gradient",
    "loss",
    "searched",
    "strehl",
]

Floats = NDArray[np.float64]
WAVELENGTH, RADIUS, RELIEF_HEIGHT = 550e-9, 25e-6, 100e-6
RETINA = 200e-6 / (2 * math.tan(math.radians(45) / 2))  # distance from pupil to retina in the default eye; a = 0.25
SPOTS = (16e-6, 6e-6, 2e-6)  # successive standard deviations of the spot in which light is maximised [m]
SPREAD = 0.1  # standard deviation of the genes at the start of a search, around flat glass of n = 1.5
POPULATION, GENERATIONS, STEP = 16, 126, 0.2
MOST_GRADIENTS = 300
FIRST_STEP = 0.05  # first step of L-BFGS over all genes; with the default of 1, some searches jump to a corner and stop
RECORDED = tuple(sorted({round(1.15**i) for i in range(80)}))
TOLERANCE = 1e-2
BOUNDS = ("paraboloid", "paraboloid, then gradient")  # best lenses within the genes' ranges
GENE_NAMES = (*(f"doe_{i}{j}" for i in range(4) for j in range(4)), "refractive_index")


@dataclass(frozen=True)
class Row:
    """State of a search: the best lens after a number of PSFs.

    evaluations: number of PSFs; a PSF with its gradient counts as one
    cpu_seconds: time of one thread [s]
    strehl: Strehl ratio of the best lens
    """

    method: str
    seed: int
    evaluations: int
    cpu_seconds: float
    strehl: float


def lens(genome: Any) -> optics.Pupil:
    """Return the pupil of a genome (17,), a NumPy array or a Dr.Jit array with derivatives."""
    if isinstance(genome, np.ndarray):
        return optics.Pupil(RADIUS, optics.BSplineRelief(RELIEF_HEIGHT * genome[:16].reshape(4, 4)), n=1 + genome[16])
    import drjit as dr
    from drjit.llvm.ad import Float64, TensorXf64, UInt32

    heights = TensorXf64(RELIEF_HEIGHT * dr.gather(Float64, genome, dr.arange(UInt32, 16)), (4, 4))
    return optics.Pupil(RADIUS, optics.BSplineRelief(heights), n=1 + dr.gather(Float64, genome, UInt32(16)))


def loss(genome: Any, spot: float | None) -> Any:
    """Return the loss of a lens, which searches minimise.

    It is -log of the light in a Gaussian spot on the axis, or of the Strehl ratio near the axis.

    spot: standard deviation of the spot [m]; None: the Strehl ratio is used
    """
    import drjit as dr
    from drjit.llvm.ad import Float64

    dx, side = (0.5e-6, 33) if spot is None else (spot / 4, _side(spot))
    result = optics.psf(lens(genome), [WAVELENGTH], RETINA, dx=dx, shape=(side, side), tolerance=TOLERANCE)
    if spot is None:
        value = optics.strehl_ratio(result)
        return -math.log(value[0]) if isinstance(value, np.ndarray) else -dr.log(value.array)
    weight = np.exp(-(result.x[None, :] ** 2 + result.y[:, None] ** 2) / (2 * spot**2)) * dx**2
    if isinstance(genome, np.ndarray):
        return -math.log(float(np.sum(result.psf[0] * weight)))
    return -dr.log(dr.sum(Float64(result.tensor.array) * Float64(weight.ravel())))


def _side(spot: float) -> int:
    return 2 * math.ceil(min(3 * spot, 1.2 * RADIUS) / (spot / 4)) + 1


def gradient(genome: Floats, spot: float | None) -> tuple[float, Floats]:
    """Return the loss and its derivatives with respect to all genes."""
    import drjit as dr
    from drjit.llvm.ad import Float64

    tracked = Float64(genome)
    dr.enable_grad(tracked)
    value = loss(tracked, spot)
    dr.backward(value)
    return float(value[0]), np.array(dr.grad(tracked).numpy(), np.float64)


def strehl(genome: Floats) -> float:
    """Return the Strehl ratio, with the peak anywhere within 12 µm of the axis."""
    result = optics.psf(lens(genome), [WAVELENGTH], RETINA, dx=0.25e-6, shape=(97, 97), tolerance=1e-3)
    return float(optics.strehl_ratio(result)[0])


def start(seed: int) -> Floats:
    """Return the start of a search: rough glass with an index near 1.5."""
    return np.clip(0.5 + SPREAD * np.random.default_rng(seed).standard_normal(17), 0.0, 1.0)


@dataclass
class Watch:
    """Counter of PSFs and time of a search, which records the best lens at intervals, outside the measured time."""

    method: str
    seed: int
    rows: list[Row] = field(default_factory=list)
    evaluations: int = 0
    seconds: float = 0.0
    best: float = math.inf
    genome: Floats | None = None
    _since: float = field(default_factory=time.process_time)

    def begin_stage(self) -> None:
        """Start a stage of the search; losses of different stages are not comparable."""
        self.best = math.inf

    def saw(self, genome: Floats, value: float) -> None:
        """Count a genome that a search has evaluated, and record the best lens if an interval ends."""
        self.seconds += time.process_time() - self._since
        self.evaluations += 1
        if value < self.best:
            self.best, self.genome = value, np.array(genome)
        if self.evaluations in RECORDED:
            self.record()
        self._since = time.process_time()

    def record(self) -> None:
        """Record the present best lens."""
        assert self.genome is not None
        done = (self.method, self.seed, self.evaluations)
        if not self.rows or self.rows[-1].evaluations != self.evaluations:
            self.rows.append(Row(*done, self.seconds, strehl(self.genome)))


def by_gradient(watch: Watch, spots: Sequence[float | None]) -> None:
    """Search with L-BFGS-B within the genes' bounds, stage by stage."""
    genome = start(watch.seed)
    for spot in spots:
        watch.begin_stage()

        def tried(u: Floats, spot: float | None = spot) -> tuple[float, Floats]:
            value, slope = gradient(u, spot)
            watch.saw(u, value)
            return value, slope

        _descend(tried, genome, MOST_GRADIENTS // len(spots))
        assert watch.genome is not None
        genome = watch.genome


def _descend(tried: Callable[[Floats], tuple[float, Floats]], genome: Floats, most: int) -> Floats:
    """Minimise with L-BFGS-B, with genes in units of FIRST_STEP, and return the genome at the end.

    tried: function that returns the loss and its derivatives
    most: maximum number of evaluations, and of iterations
    """

    def scaled(v: Floats) -> tuple[float, Floats]:
        value, slope = tried(np.clip(FIRST_STEP * v, 0.0, 1.0))
        return value, FIRST_STEP * slope

    bounds = [(0, 1 / FIRST_STEP)] * genome.size
    options = {"maxfun": most, "maxiter": most}
    found = minimize(scaled, genome / FIRST_STEP, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
    return np.clip(FIRST_STEP * found.x, 0.0, 1.0)


def by_cma(watch: Watch, spots: Sequence[float | None]) -> None:
    """Search with active CMA-ES; stages have equal numbers of generations."""
    genes = [(GENES[name], GENES[name].default) for name in GENE_NAMES]
    search = SearchConfig(population=POPULATION, generations=GENERATIONS, sigma=STEP, active=True)
    optimizer = build_optimizer(Space(genes, start(watch.seed), (watch.seed,)), search)
    for generation in range(GENERATIONS):
        stage, within = divmod(generation * len(spots), GENERATIONS)
        if within < len(spots):
            watch.begin_stage()
        asked = range(generation * POPULATION, (generation + 1) * POPULATION)
        genomes = {identity: optimizer.ask(identity)[0] for identity in asked}
        losses = {}
        for identity, genome in genomes.items():
            losses[identity] = float(loss(genome, spots[stage]))
            watch.saw(genome, losses[identity])
        for identity, value in losses.items():
            optimizer.tell(identity, -value)


METHODS: dict[str, tuple[Callable[[Watch, Sequence[float | None]], None], Sequence[float | None]]] = {
    "gradient, shrinking spot": (by_gradient, SPOTS),
    "gradient, Strehl ratio": (by_gradient, (None,)),
    "CMA-ES, shrinking spot": (by_cma, SPOTS),
    "CMA-ES, Strehl ratio": (by_cma, (None,)),
}


def searched(method: str, seed: int) -> list[Row]:
    """Run one search and return its records."""
    watch = Watch(method, seed)
    run, spots = METHODS[method]
    run(watch, spots)
    watch.record()
    return watch.rows


def best_lens(index: float = 1.5) -> tuple[float, float]:
    """Return the Strehl ratios of the paraboloid in focus, and of its refinement by gradient within the gene space."""
    curvature = 1 / ((index - 1) * RETINA)
    points = optics.BSplineRelief.paraboloid(0.0, curvature, RADIUS).control_points / RELIEF_HEIGHT
    genome = np.append(points.ravel() - points.mean() + 0.5, index - 1)
    return strehl(genome), strehl(_descend(lambda u: gradient(u, None), genome, 60))
