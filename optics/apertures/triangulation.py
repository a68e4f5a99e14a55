"""Simple polygons: a check for crossing edges, triangulation, and quadrature nodes over a triangle."""

from __future__ import annotations

import numpy as np

from optics.numerics.quadrature import gauss_legendre, gauss_legendre_count, harmonics

__all__ = ["crossing", "kernel_point", "triangle_nodes", "triangles"]

# Tolerance within which edges touch or are parallel, relative to their lengths.
ROUNDING = 1e-12


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def crossing(vertices: np.ndarray) -> tuple[int, int] | None:
    """Return the indices of two edges of a polygon that cross, touch or overlap; None if there are none.

    Successive edges always share an end. They count only if the second one folds back along the first one.

    vertices: corners of the polygon, array (corner, 2).
    """
    n = len(vertices)
    along = np.roll(vertices, -1, axis=0) - vertices
    following = np.roll(along, -1, axis=0)
    size = np.hypot(*along.T) * np.hypot(*following.T)
    backwards = (np.abs(_cross(along, following)) <= ROUNDING * size) & (np.sum(along * following, axis=1) < 0)
    if backwards.any():
        i = int(np.argmax(backwards))
        return i, (i + 1) % n
    for i in range(n - 2):
        others = slice(i + 2, n if i else n - 1)
        meets = _meet(vertices[i], along[i], vertices[others], along[others])
        if meets.any():
            return i, i + 2 + int(np.argmax(meets))
    return None


def _meet(a: np.ndarray, along: np.ndarray, others: np.ndarray, along_others: np.ndarray) -> np.ndarray:
    """Return a mask of the segments that share a point with the segment from `a` to `a + along`.

    others, along_others: starts of the other segments, and the vectors to their ends.
    """
    gap = others - a
    determinant = _cross(along, along_others)
    parallel = np.abs(determinant) <= ROUNDING * np.hypot(*along) * np.hypot(*along_others.T)
    safe = np.where(parallel, 1.0, determinant)
    s, t = _cross(gap, along_others) / safe, _cross(gap, along) / safe
    cross = (np.abs(s - 0.5) <= 0.5 + ROUNDING) & (np.abs(t - 0.5) <= 0.5 + ROUNDING)
    on_one_line = np.abs(_cross(gap, along)) <= ROUNDING * np.hypot(*along)
    ends = gap @ along, (gap + along_others) @ along
    overlap = on_one_line & (np.maximum(*ends) >= 0) & (np.minimum(*ends) <= along @ along)
    return np.asarray(np.where(parallel, overlap, cross))


def kernel_point(vertices: np.ndarray) -> np.ndarray | None:
    """Return the centroid of a counterclockwise polygon if it is a kernel point, else None.

    Straight lines from a kernel point to all points of the polygon stay inside it.
    """
    following = np.roll(vertices, -1, axis=0)
    twice = _cross(vertices, following)
    centroid = ((vertices + following) * twice[:, None]).sum(axis=0) / (3 * twice.sum())
    sees = np.all(_cross(following - vertices, centroid - vertices) > 1e-9)
    return centroid if sees else None


def triangles(vertices: np.ndarray) -> np.ndarray:
    """Cut a counterclockwise polygon into triangles (m, 3, 2) by clipping ears (Meisters 1975)."""
    left, ears = list(range(len(vertices))), []
    while len(left) > 3:
        # The ear with the shortest cut is clipped first, so that triangles stay compact.
        best, shortest = -1, np.inf
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            cut = float(np.hypot(*(vertices[c] - vertices[a])))
            if cut < shortest and _is_ear(vertices, a, b, c, left):
                best, shortest = k, cut
        a, b, c = left[best - 1], left[best], left[(best + 1) % len(left)]
        ears.append((a, b, c))
        del left[best]
    ears.append((left[0], left[1], left[2]))
    corners = vertices[np.array(ears)]
    flat = _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) > 1e-14
    return np.asarray(corners[flat])


def _is_ear(vertices: np.ndarray, a: int, b: int, c: int, left: list[int]) -> bool:
    """Return whether the corner a, b, c turns left or is straight, and its triangle contains no other corner.

    left: indices of the corners of the remaining polygon.
    """
    corner = vertices[[a, b, c]]
    if _cross(corner[1] - corner[0], corner[2] - corner[1]) < 0:
        return False
    others = vertices[[k for k in left if k not in (a, b, c)]]
    sides = [_cross(corner[(k + 1) % 3] - corner[k], others - corner[k]) >= 0 for k in range(3)]
    return not np.any(sides[0] & sides[1] & sides[2])


def triangle_nodes(parts: np.ndarray, cycles: float, digits: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x, y and weights of Gauss-Legendre nodes over triangles (Duffy 1982).

    The nodes of a triangle lie on lines parallel to the side opposite the first corner. Shorter lines have fewer nodes.

    parts: corners, (triangle, 3, 2).
    """
    apex, first, side = parts[:, 0], parts[:, 1] - parts[:, 0], parts[:, 2] - parts[:, 1]
    far = np.linalg.norm(parts[:, 1:] - apex[:, None], axis=2).max(axis=1)
    rules = [gauss_legendre(gauss_legendre_count(cycles * reach, digits, degree=1)) for reach in far.tolist()]
    line = np.repeat(np.arange(len(parts)), [len(u) for u, _ in rules])  # triangle of each line
    u, u_weight = (np.concatenate(column) for column in zip(*rules, strict=True))
    counts = (harmonics(np.pi * cycles * np.linalg.norm(side, axis=1)[line] * u, digits) + 1) // 2
    along = [gauss_legendre(n) for n in counts.tolist()]
    v, v_weight = (np.concatenate(column) for column in zip(*along, strict=True))
    twice, node = np.abs(_cross(first, side)), np.repeat(np.arange(len(line)), counts)  # line of each node
    of = line[node]
    x, y = (apex[of] + u[node, None] * (first[of] + v[:, None] * side[of])).T
    return x, y, twice[of] * u[node] * u_weight[node] * v_weight
