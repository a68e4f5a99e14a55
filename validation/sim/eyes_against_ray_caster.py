"""Eyes on third-party models, compared with MuJoCo's ray caster

Do eyes on any MuJoCo model see the surfaces that MuJoCo's ray caster hits? In each of 53 third-party models, the two
agree for at least 99.997 % of the receptors: both find the same depth to 1e-3, or both see nothing.

**Method.** The models are those of the page `scene_against_mujoco` that have moving parts. One eye is mounted on an
added camera that looks at the model from a random side. Up to three more eyes are mounted on cameras of the model
itself. Five worlds with random poses are rendered at once. For the centre of every receptor, the depth from
`sim.ModelRenderer` is compared with the depth from MuJoCo's ray caster.

**Table.** The columns state the number of moving geoms, the fraction of receptors with the same depth, and this
fraction for the eye and world in which it is smallest. The last column states steps per CPU second. This rate was
measured without physics, in 64 worlds with two eyes of 15 x 15 receptors and 4 rays per receptor.

**Bounds.** The script fails if, in any model, the two agree for fewer than 99.5 % of the receptors.

**Limits.** The receptors whose depths differ look at the edge of a curved surface that is approximated by triangles, or
at the inside of a surface. MuJoCo's rays hit the inside of a surface, but eyes see through it. The back of a plane is
the opposite case: eyes see it, but MuJoCo's rays do not hit it. Only eyes in front of every plane are therefore
counted.

    PYTHONPATH=DIR python -m validation.sim.eyes_against_ray_caster [--only suite] [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

import drjit as dr
import mujoco
import numpy as np

import optics
import sim
from sim.scene.cameras import Viewpoint
from sim.scene.mirror import VISIBLE_GROUPS
from validation.pages.page import Page, parser
from validation.sim.scene_against_mujoco import model_files, move

WORLDS, RESOLUTION, FOV_DEG = 5, (60, 80), 60.0
SAME, TOLERANCE = 0.995, 1e-3
CAMERA, OWN_CAMERAS, DIRECTIONS = "from_a_side", 3, 50
ON_SURFACE = 1e-9  # [m]
MANY, ROUNDS = 64, 5


@dataclass(frozen=True)
class Row:
    """Results for one model.

    moving: number of moving geoms.
    same: share of receptors with the same depth.
    worst: that share for the worst eye of a world.
    rate: steps per CPU second.
    """

    name: str
    moving: int
    same: float
    worst: float
    rate: float


def with_camera(path: Path, rng: np.random.Generator) -> mujoco.MjModel:
    """Return a model with an added camera that looks at it.

    Raises:
        ValueError: the file is only a part of a model.
    """
    spec = mujoco.MjSpec.from_file(str(path))
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    target = np.median(data.xipos[1:], axis=0) if model.nbody > 1 else np.zeros(3)
    for _ in range(DIRECTIONS):
        azimuth, elevation = rng.uniform(-np.pi, np.pi), rng.uniform(0.2, 1.4)
        direction = [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
        view = Viewpoint.looking_at(target + 1.2 * model.stat.extent * np.array(direction), target)
        if before_planes(model, data, view.position):
            break
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, view.rotation.ravel())
    spec.worldbody.add_camera(name=CAMERA, pos=view.position.tolist(), quat=quat.tolist())
    return spec.compile()


def before_planes(model: mujoco.MjModel, data: mujoco.MjData, point: np.ndarray) -> bool:
    """Return whether a point is on the front side of every plane."""
    planes = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
    normals = data.geom_xmat[planes].reshape(-1, 3, 3)[..., 2]
    return bool((np.einsum("gi,gi->g", normals, point - data.geom_xpos[planes]) > 0).all())


def posed(model: mujoco.MjModel, rng: np.random.Generator) -> mujoco.MjData:
    """Return a state with all joints at random positions within their ranges."""
    data = mujoco.MjData(model)
    for joint in range(model.njnt):
        move(model, data.qpos, joint, rng)
    mujoco.mj_forward(model, data)
    return data


def mounts_on(model: mujoco.MjModel) -> list[sim.Mount]:
    """Return mounts on the added camera and on the model's own cameras."""
    names = [model.camera(i).name for i in range(model.ncam) if model.camera(i).name not in ("", CAMERA)]
    return [sim.Mount(name, kind="camera") for name in (CAMERA, *names[:OWN_CAMERAS])]


def compare(name: str, model: mujoco.MjModel, rng: np.random.Generator) -> Row | None:
    """Return the results of one model; None if it has no moving parts, or if no eye can be mounted."""
    eye, datas = optics.Eye(resolution=RESOLUTION, fov_deg=FOV_DEG), [posed(model, rng) for _ in range(WORLDS)]
    renderer = None
    for mounts in (mounts_on(model), mounts_on(model)[:1]):  # cameras inside geoms are refused
        try:
            renderer = sim.ModelRenderer(model, eye, mounts, WORLDS, sim.Fidelity(1, bands=1))
            break
        except ValueError:
            continue
    if renderer is None or not renderer.moving:
        return None
    seen, cast = renderer.depth(datas), expected(renderer, datas)
    # A MuJoCo ray that starts on a surface ends there; the camera of a head may lie on one.
    same = (np.isclose(seen, cast, rtol=TOLERANCE, atol=0) | (cast < ON_SURFACE)).mean(axis=(2, 3))
    same = same[in_front(renderer, datas)]
    return Row(name, renderer.moving, float(same.mean()), float(same.min()), rate(model, datas))


def in_front(renderer: sim.ModelRenderer, datas: list[mujoco.MjData]) -> np.ndarray:
    """Return the mask (world, eye) of the eyes that are on the front side of every plane."""
    pupils, _ = renderer.eye_frames(sim.Poses.from_data(datas))
    eyes = [
        [before_planes(renderer.model, data, pupil) for pupil in own] for data, own in zip(datas, pupils, strict=True)
    ]
    return np.array(eyes)


def expected(renderer: sim.ModelRenderer, datas: list[mujoco.MjData]) -> np.ndarray:
    """Return depths by mj_ray, (world, eye, y, x); MuJoCo 4.0.0's mj_multiRay misses some limbs of some geoms."""
    pupils, frames = renderer.eye_frames(sim.Poses.from_data(datas))
    rows, columns = RESOLUTION
    side = 2 * np.tan(np.radians(FOV_DEG) / 2) / columns
    y, x = np.indices(RESOLUTION)
    plane = np.stack([(x + 0.5 - columns / 2) * side, (rows / 2 - y - 0.5) * side, np.ones(RESOLUTION)], axis=-1)
    groups = np.array([g in VISIBLE_GROUPS for g in range(mujoco.mjNGROUP)], np.uint8)
    found, geom = np.empty((len(datas), pupils.shape[1], *RESOLUTION)), np.empty(1, np.int32)
    for w, e in np.ndindex(*found.shape[:2]):
        rays = plane @ frames[w, e].T
        for place in np.ndindex(*RESOLUTION):
            met = mujoco.mj_ray(renderer.model, datas[w], pupils[w, e], rays[place], groups, 1, -1, geom, None)
            found[w, e][place] = met if met >= 0 else np.inf
    return found


def rate(model: mujoco.MjModel, datas: list[mujoco.MjData]) -> float:
    """Return steps per CPU second, the median of a few rounds."""
    mounts = [sim.Mount(CAMERA), sim.Mount(CAMERA, azimuth_deg=30)]
    renderer = sim.ModelRenderer(model, optics.Eye(), mounts, MANY, sim.Fidelity(4, bands=4))
    many, seconds = [datas[i % len(datas)] for i in range(MANY)], []
    for _ in range(2):
        renderer.signals(many)
    for _ in range(ROUNDS):
        began = time.process_time()
        renderer.signals(many)
        seconds.append(time.process_time() - began)
    return MANY / float(np.median(seconds))


def measure(only: str = "") -> list[Row]:
    rows = []
    for name, path in model_files():
        if only not in name:
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                model = with_camera(path, np.random.default_rng(0))
                row = compare(name, model, np.random.default_rng(1))
            except ValueError:
                continue
        if row:
            rows.append(row)
            print(line(row), flush=True)
    return rows


def line(row: Row) -> str:
    return f"{row.name:<66} {row.moving:6d} {row.same:9.3%} {row.worst:9.3%} {row.rate:8.0f}"


def table(rows: list[Row]) -> str:
    head = f"{'model':<66} {'moving':>6} {'depth':>9} {'worst':>9} {'steps/s':>8}"
    return "\n".join([head, *map(line, rows), f"{len(rows)} models"])


def broken_bounds(rows: list[Row]) -> list[str]:
    return [f"{r.name}: {r.same:.3%} of the receptors have the same depth" for r in rows if r.same < SAME]


def draw_figure(rows: list[Row], path: Path) -> None:
    """Draw steps over the number of moving geoms."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.subplots()
    axes.loglog([r.moving for r in rows], [r.rate for r in rows], "o", ms=4, color="#0072B2", label="a model")
    axes.set(xlabel="number of moving geoms", ylabel="steps per CPU second, 64 worlds")
    axes.set_title("Moving geoms outside the eyes' view cost little", fontsize=10)
    axes.legend(frameon=False)
    figure.savefig(path, dpi=110)


def main(arguments: list[str] | None = None) -> int:
    dr.set_thread_count(1)
    asked = parser(__doc__)
    asked.add_argument("--only", default="", help="only models whose names contain this")
    options: argparse.Namespace = asked.parse_args(arguments)
    rows = measure(options.only)
    if not rows:
        print(
            "no models found: see validation/sim/scene_against_mujoco.py for what to install, or another --only",
            file=sys.stderr,
        )
        return 2
    page = Page("eyes_against_ray_caster", __doc__, table(rows), broken_bounds(rows))
    return page.publish(options, lambda path: draw_figure(rows, path))


if __name__ == "__main__":
    sys.exit(main())
