"""The lattice of pixels that are rendered first: no line one pixel wide fits between them."""

import numpy as np
import pytest

from sim.pictures.lattice import PERIOD, Lattice


@pytest.mark.parametrize("size", [(36, 48), (7, 11), (1, 9), (1, 1)])
def test_every_pixel_is_or_touches_one_of_them(size):
    lattice = Lattice.for_size(size)
    y, x = np.indices(size)
    own_y, own_x = np.divmod(lattice.pixels[lattice.nearest].reshape(size), size[1])
    assert (abs(y - own_y) + abs(x - own_x)).max() <= 1
    assert len(np.unique(lattice.pixels)) == len(lattice.pixels)


def test_a_line_of_pixels_is_seen_whole():
    """Every pixel of a horizontal, vertical or diagonal line is rendered, wherever the line is. A grid of every other
    column and row has more pixels, but would miss half of the vertical lines.
    """
    size = (40, 40)
    lattice = Lattice.for_size(size)
    y, x = np.indices(size)
    for k in range(15, 15 + PERIOD):
        for line in (x == k, y == k, x - y == k - 17, x + y == k + 22):
            shown = line.ravel()[lattice.pixels]
            found = np.zeros(line.size, bool)
            found[lattice.pixels] = True
            found[lattice.between(shown[lattice.pairs[0]] != shown[lattice.pairs[1]])] = True
            inner = (line & (np.abs(x - 19.5) < 15) & (np.abs(y - 19.5) < 15)).ravel()
            assert found[inner].all()


def test_nothing_is_looked_at_again_where_all_is_alike():
    lattice = Lattice.for_size((20, 30))
    assert len(lattice.between(np.zeros(lattice.pairs.shape[1], bool))) == 0
    assert len(lattice.pixels) < 0.3 * 20 * 30
