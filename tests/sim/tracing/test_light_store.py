"""The cache of reflected light returns exactly the tables that were baked, whatever happened to its files."""

import io
import os
import shutil
import struct
import tracemalloc
import zipfile

import numpy as np
import pytest

from sim.render.world_scene import WorldScene
from sim.tracing import lighting
from sim.tracing.areas import light_baking, light_store
from sim.worlds.world import build_world
from tests.sim.tracing.area_views import EYES, stairs


@pytest.fixture(autouse=True)
def own_store(monkeypatch, tmp_path):
    """Use a temporary store instead of the user's cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


class Bakery:
    """A world whose tables are baked in no time.

    number: distinguishes worlds of the same layout
    """

    def __init__(self, number=0):
        self.ingredients, self.baked = [np.array(float(number))], 0
        self.layout = {"bounced_floor_0": 18, "bounced_floor_1": 18, "bounced_walls_0": 24, "bounced_body_0_0": 32}
        rng = np.random.default_rng(number)
        self.right = {name: rng.random(size, np.float32) for name, size in self.layout.items()}

    def tables(self):
        self.baked += 1
        return dict(self.right)

    def check(self):
        """Load the tables, which must be right. Return whether they came from disk."""
        before, found = self.baked, light_store.stored(self)
        assert found.keys() == self.right.keys()
        for name, table in self.right.items():
            assert (found[name].dtype, found[name].shape) == (table.dtype, table.shape)
            np.testing.assert_array_equal(found[name], table)
        return self.baked == before


def stored_file(bakery):
    """Bake the tables, and return the path of their file."""
    assert not bakery.check()
    assert bakery.check()
    (path,) = light_store.cache_folder().glob("*.npz")
    return path


def damaged(content, rng):
    """Return the bytes with one kind of damage, drawn at random."""
    data = bytearray(content)
    first, last = sorted(rng.integers(0, len(data), 2))
    kind = rng.integers(9)
    if kind == 0:
        return bytes(data[:first])
    if kind == 1:
        data[first] ^= 1 << int(rng.integers(8))
    elif kind == 2:
        data[first:last] = bytes(last - first)
    elif kind == 3:
        data[first:last] = rng.bytes(last - first)
    elif kind == 4:
        data[first:first] = rng.bytes(int(rng.integers(1, 50)))
    elif kind == 5:
        del data[first : first + int(rng.integers(1, 50))]
    elif kind == 6:
        data[first : first + 4] = struct.pack("<I", rng.choice([0, 1, 0x7FFFFFFF, 0xFFFFFFFF]))
    elif kind == 7:
        headers = [i for i in range(len(data)) if data[i : i + 6] == b"\x93NUMPY"]
        at = int(rng.choice(headers)) + int(rng.integers(128))
        data[at : at + 1] = rng.bytes(1)
    else:
        centre = data.index(b"PK\x01\x02")
        at = int(rng.integers(centre, len(data)))
        data[at : at + 1] = rng.bytes(1)
    return bytes(data)


def attack(seed, times):
    """Return how often tables were baked again after so many damages; every damage must be harmless."""
    bakery = Bakery()
    path = stored_file(bakery)
    content, rng = path.read_bytes(), np.random.default_rng(seed)
    again = 0
    for _ in range(times):
        path.write_bytes(damaged(content, rng))
        again += not bakery.check()
    return again


def test_no_damage_changes_a_table():
    """Undetected damages are in bytes that tables do not depend on, such as dates in the archive."""
    assert attack(47, 400) > 250


@pytest.mark.slow
def test_no_damage_of_thousands_changes_a_table():
    assert attack(0, 4000) > 2500


def archive(**tables):
    content = io.BytesIO()
    np.savez(content, **tables)
    return content.getvalue()


def plain_array(right):
    content = io.BytesIO()
    np.save(content, next(iter(right.values())))
    return content.getvalue()


def announcing(right, announced):
    """Return an archive of the right names whose first header announces another shape."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as file:
        for i, (name, table) in enumerate(right.items()):
            header = io.BytesIO()
            shape = (announced,) if i == 0 else table.shape
            np.lib.format.write_array_header_1_0(header, {"descr": "<f4", "fortran_order": False, "shape": shape})
            file.writestr(f"{name}.npy", header.getvalue() + table.tobytes())
    return content.getvalue()


def bomb(right):
    """Return a compressed archive of the right names whose first table is 16 MB of zeros."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as file:
        for i, name in enumerate(right):
            file.writestr(f"{name}.npy", bytes(0 if i else 2**24))
    return content.getvalue()


def changed(right, name="bounced_walls_0", **changes):
    """Return a valid archive, with the right checksum for its content, in which one table is changed or missing."""
    tables = {key: changes.get("table", table) if key == name else table for key, table in right.items()}
    if changes.get("missing"):
        del tables[name]
    tables |= changes.get("more", {})
    world = light_store._digest(Bakery().ingredients)
    sums = {light_store.CHECKSUM: light_store._checksum(tables, world)}
    return archive(**tables, **sums)


FOREIGN = {
    "missing key": lambda right: changed(right, missing=True),
    "no keys": lambda right: archive(),
    "foreign names": lambda right: archive(**{f"x_{name}": table for name, table in right.items()}),
    "one name more": lambda right: changed(right, more={"x": np.zeros(1, np.float32)}),
    "other size": lambda right: changed(right, table=np.zeros(25, np.float32)),
    "other shape": lambda right: changed(right, table=np.zeros((24, 1), np.float32)),
    "float64": lambda right: changed(right, table=np.zeros(24)),
    "big endian": lambda right: changed(right, table=np.zeros(24, ">f4")),
    "int32": lambda right: changed(right, table=np.zeros(24, np.int32)),
    "objects": lambda right: archive(**right, sha256=np.array([None], dtype=object)),
    "NaN": lambda right: changed(right, table=np.full(24, np.nan, np.float32)),
    "infinity": lambda right: changed(right, table=np.full(24, np.inf, np.float32)),
    "no checksum": lambda right: archive(**right),
    "4 TB announced": lambda right: announcing(right, 10**12),
    "negative size announced": lambda right: announcing(right, -1),
    "plain array": plain_array,
    "zip bomb": bomb,
    "empty file": lambda right: b"",
    "text": lambda right: b"light",
    "large file": lambda right: archive(**right) + bytes(10**7),
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_a_foreign_file_is_baked_again(kind):
    bakery = Bakery()
    path = stored_file(bakery)
    path.write_bytes(FOREIGN[kind](bakery.right))
    assert not bakery.check()
    assert bakery.check(), "the file is replaced"


def test_the_file_of_another_world_of_the_same_layout_is_not_used():
    one, other = Bakery(1), Bakery(2)
    path = stored_file(one)
    assert not other.check()
    (others,) = set(light_store.cache_folder().glob("*.npz")) - {path}
    shutil.copy(others, path)
    assert not one.check()


def test_a_header_allocates_nothing():
    """Reading takes little memory, although a header announces 4 TB or a table expands to 16 MB."""
    bakery = Bakery()
    path = stored_file(bakery)
    for content in (bomb(bakery.right), announcing(bakery.right, 10**12)):
        path.write_bytes(content)
        tracemalloc.start()
        assert not bakery.check()
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 2e6


@pytest.mark.parametrize("make", [os.mkdir, os.mkfifo])
def test_a_folder_or_a_pipe_in_place_of_the_file(make):
    bakery = Bakery()
    path = stored_file(bakery)
    path.unlink()
    make(path)
    assert not bakery.check()


def test_without_a_disk_it_is_baked_every_time(monkeypatch, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    bakery = Bakery()
    assert not bakery.check()
    assert not bakery.check()


def test_a_full_disk_leaves_no_file(monkeypatch):
    def full(file, **tables):
        file.write(b"PK")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", full)
    assert not Bakery().check()
    assert not list(light_store.cache_folder().iterdir())


def test_old_files_go_first(monkeypatch, tmp_path):
    monkeypatch.setattr(light_store, "KEPT", 3)
    for i in range(6):
        light_store._write(tmp_path / f"{i}.npz", {"a": np.zeros(1, np.float32)}, "world")
        os.utime(tmp_path / f"{i}.npz", (i, i))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["3.npz", "4.npz", "5.npz"]


def sizes_and_layout(world, monkeypatch):
    """Return the sizes of a world's tables, baked with few rays, and the layout that the store expects."""
    monkeypatch.setattr(light_baking, "RAYS", 2)
    monkeypatch.setattr(light_baking, "BODY_RAYS", 2)
    monkeypatch.setattr(light_baking, "ORDERS", 1)
    found = []
    right = light_baking.Baking.tables
    monkeypatch.setattr(
        light_baking.Baking, "tables", lambda self: found.append((self.layout, right(self))) or found[-1][1]
    )
    WorldScene(world, EYES).areas(lighting.BOUNCE)
    WorldScene(world, EYES).areas(lighting.BOUNCE)
    ((layout, tables),) = found  # baked once
    assert {table.dtype for table in tables.values()} == {np.dtype(np.float32)}
    return {name: table.shape for name, table in tables.items()}, {name: (size,) for name, size in layout.items()}


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("name", ["detection", "stairs", "foraging", "navigation", "maze"])
def test_the_expected_layout_is_the_baked_one(name, monkeypatch):
    sizes, layout = sizes_and_layout(stairs() if name == "stairs" else build_world(name), monkeypatch)
    assert sizes == layout
