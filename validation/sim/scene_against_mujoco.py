"""Mirrored scenes of third-party models, compared with MuJoCo's own renderer

Do mirrored models agree with MuJoCo's own renderer? (The mirror of a model is its conversion to a Mitsuba scene.) In
each of 59 third-party models, at least 99.796 % of the pixels show the same geom. Of the pixels that show the same
geom, at least 99.900 % have the same depth to 1e-3.

**Method.** Every model is put into five random poses. Each pose is rendered from a random direction. If the model has
cameras (fixed or tracking), the pose is also rendered by one of these. In each image, the geom seen through the centre
of every pixel is compared with MuJoCo's segmentation renderer. Where the geoms agree, the depth is compared with
MuJoCo's ray caster. (The segmentation renderer draws round shapes as polygons, here of 96 slices. The ray caster uses
exact shapes.)

**Table.** The columns state the number of geoms, the fraction of pixels that show the same geom, this fraction in the
worst image, and the fraction of these pixels that have the same depth. The last column lists the features of the model
that the mirror lacks, as reported by the mirror.

**Bounds.** In every model, at least 99.5 % of the pixels show the same geom, and at least 99.9 % of those have the same
depth to 1e-3.

**Limits.** The pixels that differ are at the edges of curved surfaces, which the mirror approximates by triangles. The
models are all files in dm_control (suite, locomotion, third-party robots), gymnasium-robotics and gymnasium that are
complete models. (The other files are parts of models.) They are not part of rhabdom. Install them with `pip install
'rhabdom[validation]'`. If pinned versions conflict, use `pip install --no-deps --target DIR dm_control
gymnasium-robotics` and add DIR to PYTHONPATH.

    python -m validation.sim.scene_against_mujoco [--only WORD] [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

import sim
from sim.scene.cameras import Viewpoint
from sim.scene.mirror import VISIBLE_GROUPS, Mirror, MirrorWarning
from validation.pages.page import Page, parser
from validation.sim.mujoco_pictures import Shot, draw

POSES, WIDTH, HEIGHT = 5, 240, 180
SAME_GEOM, SAME_DEPTH, DEPTH_TOLERANCE = 0.995, 0.999, 1e-3
# Package, folder, and pattern of the files that are whole models.
COLLECTIONS = (
    ("dm_control", "suite", "*.xml"),
    ("dm_control", "locomotion", "walkers/assets/**/*.xml"),
    ("dm_control", "locomotion", "soccer/assets/**/*.xml"),
    ("dm_control", "third_party", "**/*.xml"),
    ("gymnasium_robotics", "envs/assets", "*/*.xml"),
    ("gymnasium", "envs/mujoco/assets", "*.xml"),
)


@dataclass(frozen=True)
class Row:
    """Results for one model.

    same_geom: fraction of all pixels that show the same geom.
    same_depth: fraction with the same depth, of the pixels that show the same geom and whose ray hits it.
    worst_picture: fraction of pixels with the same geom in the worst image.
    lacks: features that the mirror reports as missing.
    """

    name: str
    geoms: int
    same_geom: float
    worst_picture: float
    same_depth: float
    lacks: str


def model_files() -> Iterator[tuple[str, Path]]:
    """Yield (name, path) of every file that may be a model."""
    for package, folder, pattern in COLLECTIONS:
        found = importlib.util.find_spec(package)
        for root in (found.submodule_search_locations or []) if found else []:
            for path in sorted((Path(root) / folder).glob(pattern)):
                if "touch_sensors" in path.name:
                    continue  # the same hands with additional sites
                yield f"{package}/{path.relative_to(root)}".removesuffix(".xml"), path


def poses(model: mujoco.MjModel, rng: np.random.Generator) -> Iterator[Shot]:
    """Yield random poses with moved and rotated mocap bodies.

    Each pose is seen from a random direction above the horizon and, if the model has cameras, by one of these in turn.
    """
    data = mujoco.MjData(model)
    for i in range(POSES):
        mujoco.mj_resetData(model, data)
        for joint in range(model.njnt):
            move(model, data.qpos, joint, rng)
        data.mocap_pos += rng.normal(0, 0.1 * model.stat.extent, data.mocap_pos.shape)
        if model.nmocap:
            data.mocap_quat[:] = [_quat(rng) for _ in range(model.nmocap)]
        mujoco.mj_forward(model, data)
        state = data.qpos.copy(), data.mocap_pos.copy(), data.mocap_quat.copy()
        moving = data.xipos[1:] if model.nbody > 1 else data.xipos
        distance = rng.uniform(0.7, 1.5) * model.stat.extent
        free = np.array([*np.median(moving, axis=0), distance, rng.uniform(-180, 180), rng.uniform(-70, -10)])
        yield Shot(*state, -1, free)
        if model.ncam:
            yield Shot(*state, i % model.ncam, free)


def _quat(rng: np.random.Generator) -> np.ndarray:
    quat = rng.normal(size=4)
    return quat / np.linalg.norm(quat)


def move(model: mujoco.MjModel, qpos: np.ndarray, joint: int, rng: np.random.Generator) -> None:
    """Move a joint to a random position within its range."""
    kind, at = mujoco.mjtJoint(int(model.jnt_type[joint])), model.jnt_qposadr[joint]
    if kind == mujoco.mjtJoint.mjJNT_FREE:
        qpos[at : at + 3] += rng.uniform(-0.1, 0.1, 3) * model.stat.extent
        qpos[at + 3 : at + 7] = _quat(rng)
    elif kind == mujoco.mjtJoint.mjJNT_BALL:
        qpos[at : at + 4] = _quat(rng)
    elif model.jnt_limited[joint]:
        qpos[at] = rng.uniform(*model.jnt_range[joint])
    else:
        qpos[at] += rng.uniform(-1, 1) * (np.pi if kind == mujoco.mjtJoint.mjJNT_HINGE else 0.1 * model.stat.extent)


def compare(name: str, model: mujoco.MjModel) -> Row:
    """Return the results of one model.

    Raises:
        RuntimeError: MuJoCo cannot render.
    """
    shots = list(poses(model, np.random.default_rng(0)))
    pictures = draw(model, shots, WIDTH, HEIGHT)
    if pictures is None:
        raise RuntimeError(f"{name}: MuJoCo's renderer found no OpenGL (MUJOCO_GL=egl or osmesa)")
    data = mujoco.MjData(model)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", MirrorWarning)
        mirror = sim.mirror(model)
    shares, same_depth = [], []
    for shot, drawn in zip(shots, pictures[0], strict=True):
        shot.apply(data)
        mujoco.mj_forward(model, data)
        mirror.sync(data)
        same, close = _agreement(mirror, data, shot, drawn)
        shares.append(same.mean())
        same_depth.append(close)
    lacks = "; ".join(str(w.message).removeprefix("not mirrored: ") for w in said if w.category is MirrorWarning)
    deep = np.concatenate(same_depth)
    depth = float(deep.mean()) if len(deep) else 1.0
    return Row(name, len(mirror.geoms), float(np.mean(shares)), float(np.min(shares)), depth, lacks)


def _agreement(mirror: Mirror, data: mujoco.MjData, shot: Shot, drawn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mask (y, x) of pixels that show the same geom, and, for some of them, whether the depth is the same.

    Depths are compared only in pixels in which the ray caster hits the same geom.
    """
    view = _viewpoint(mirror, shot)
    seen, depth = mirror.render_ids(view, WIDTH, HEIGHT), mirror.render_depth(view, WIDTH, HEIGHT)
    cast, distance = _cast(mirror, data, view)
    same = seen == drawn
    both = same & (seen >= 0) & (cast == seen)
    return same, np.abs(depth[both] - distance[both]) <= DEPTH_TOLERANCE * distance[both]


def _viewpoint(mirror: Mirror, shot: Shot) -> Viewpoint:
    if shot.camera >= 0:
        return mirror.viewpoint(shot.camera)
    return Viewpoint.looking_at(*shot.origin_and_target(), mirror.model.vis.global_.fovy)


def _cast(mirror: Mirror, data: mujoco.MjData, view: Viewpoint) -> tuple[np.ndarray, np.ndarray]:
    """Return the geom ids (y, x) and depth [m] by mj_multiRay."""
    rays = view.rays(WIDTH, HEIGHT).reshape(-1, 3)
    length = np.linalg.norm(rays, axis=1)
    n = len(rays)
    ids, distance = np.full(n, -1, np.int32), np.full(n, -1.0)
    groups = np.array([1, 1, 1, 0, 0, 0], np.uint8)
    unit = np.ascontiguousarray(rays / length[:, None]).ravel()
    mujoco.mj_multiRay(mirror.model, data, view.position, unit, groups, True, -1, ids, distance, None, n, 1e9)
    return ids.reshape(HEIGHT, WIDTH), (distance / length).reshape(HEIGHT, WIDTH)


def measure(only: str = "") -> tuple[list[Row], list[str]]:
    """Return the rows of the models with `only` in their names, and the files that are only parts of models."""
    rows, fragments = [], []
    for name, path in model_files():
        if only not in name:
            continue
        try:
            model = mujoco.MjModel.from_xml_path(str(path))
        except ValueError:
            fragments.append(name)
            continue
        if not np.isin(model.geom_group, VISIBLE_GROUPS).any():
            fragments.append(name)
            continue
        rows.append(compare(name, model))
        print(_line(rows[-1]), flush=True)
    return rows, fragments


def broken_bounds(rows: list[Row]) -> list[str]:
    """Return the descriptions of the bounds that do not hold."""
    words = [f"{r.name}: {r.same_geom:.3%} of pixels show the same geom" for r in rows if r.same_geom < SAME_GEOM]
    return words + [f"{r.name}: {r.same_depth:.3%} have the same depth" for r in rows if r.same_depth < SAME_DEPTH]


def _line(row: Row) -> str:
    shares = f"{row.same_geom:9.3%} {row.worst_picture:9.3%} {row.same_depth:9.3%}"
    return f"{row.name:<66} {row.geoms:5d} {shares}  {row.lacks}"


def table(rows: list[Row], fragments: list[str]) -> str:
    head = f"{'model':<66} {'geoms':>5} {'same id':>9} {'worst':>9} {'depth':>9}  not mirrored"
    worst = f"{'the worst':<66} {'':5} {min(r.same_geom for r in rows):9.3%} {min(r.worst_picture for r in rows):9.3%} "
    worst += f"{min(r.same_depth for r in rows):9.3%}"
    count = f"{len(rows)} models; {len(fragments)} further files are parts of models"
    return "\n".join([head, *map(_line, rows), worst, count])


def draw_figure(rows: list[Row], path: Path) -> None:
    """Draw deviations from full agreement, per model."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 0.16 * len(rows) + 1.5), layout="constrained")
    axes, y = figure.subplots(), np.arange(len(rows))
    for values, bar, color, label in (
        ([r.same_geom for r in rows], SAME_GEOM, "#0072B2", "geom differs from MuJoCo's renderer"),
        ([r.same_depth for r in rows], SAME_DEPTH, "#D55E00", "same geom, but depth differs from the ray caster"),
    ):
        axes.plot(np.maximum(1 - np.array(values), 1e-6), y, "o", ms=3, color=color, label=label)
        axes.axvline(1 - bar, color=color, lw=1, ls=":")
    axes.set_yticks(y, [r.name for r in rows], fontsize=5)
    axes.set(xscale="log", xlabel="share of pixels (dotted: bounds)", ylim=(len(rows), -1))
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=110)


def main(arguments: list[str] | None = None) -> int:
    asked = parser(__doc__)
    asked.add_argument("--only", default="", help="only models whose names contain this")
    options: argparse.Namespace = asked.parse_args(arguments)
    rows, fragments = measure(options.only)
    if not rows:
        print("no models found: pip install 'rhabdom[validation]', or another --only", file=sys.stderr)
        return 2
    page = Page("scene_against_mujoco", __doc__, table(rows, fragments), broken_bounds(rows))
    return page.publish(options, lambda path: draw_figure(rows, path))


if __name__ == "__main__":
    sys.exit(main())
