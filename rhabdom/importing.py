"""Locations of the packages `optics`, `sim` and `evolve`, and conflicts with other packages of the same names.

In a checkout the three packages lie next to this one. In an installation they lie in `rhabdom/packages`, which
`rhabdom.pth` adds to Python's path. They are not installed next to this package, because the package index contains
another project named `optics`. Two projects that install the same folder overwrite each other's files, and uninstalling
one deletes files of the other.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import spec_from_loader
from pathlib import Path
from types import ModuleType

__all__ = ["HOME", "NAMES", "come_first", "namesakes"]

NAMES = ("optics", "sim", "evolve")
_BESIDE = Path(__file__).resolve().parent / "packages"
HOME = _BESIDE if _BESIDE.is_dir() else _BESIDE.parents[1]  # the folder that contains the three packages


def come_first() -> None:
    """Make `import optics`, `import sim` and `import evolve` import rhabdom's packages.

    `rhabdom.optics` is then the same module as `optics`. Python's path stays unchanged if the imports already find
    rhabdom's packages.

    Warns:
        RuntimeWarning: without this function, the imports would find packages of other projects; the message names
            these projects.

    Raises:
        ImportError: another `optics`, `sim` or `evolve` has already been imported; the message names it.
    """
    if not any(isinstance(finder, _Alias) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Alias())
    for name in NAMES:
        if (loaded := sys.modules.get(name)) is not None and (at := _place(loaded.__spec__)) != HOME / name:
            raise ImportError(f"{at}: is already imported as {name}; import rhabdom first")
    before = {name: PathFinder.find_spec(name) for name in NAMES}
    if all(spec is not None and _place(spec) == HOME / name for name, spec in before.items()):
        return
    sys.path.insert(0, str(HOME))
    others = [f"{_place(spec)}" for name, spec in before.items() if spec is not None and _place(spec) != HOME / name]
    if others:
        said = "; ".join(namesakes()) or f"rename {', '.join(others)}"
        warnings.warn(f"rhabdom's packages hide others of the same names: {said}", RuntimeWarning, stacklevel=3)


def namesakes() -> list[str]:
    """Return one line for each other project that has installed a package `optics`, `sim` or `evolve`.

    The line states how to remove the project.
    """
    from importlib import metadata  # imported here because it is needed only for this message

    owners = metadata.packages_distributions()
    return [
        f"the project {other} {metadata.version(other)} holds a package {name} too: pip uninstall {other}"
        for name in NAMES
        for other in dict.fromkeys(owners.get(name, ()))
        if other != "rhabdom"
    ]


def _place(spec: ModuleSpec | None) -> Path | None:
    """Return the folder of a package or the file of a module; None if there is no such file."""
    if spec is None or spec.origin is None:
        return None
    path = Path(spec.origin).resolve()
    return path.parent if path.stem == "__init__" else path


class _Alias(MetaPathFinder, Loader):
    """Importer that makes `rhabdom.optics.eye` the module `optics.eye` instead of a second copy."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        head, _, rest = name.partition(".")
        return spec_from_loader(name, self) if head == "rhabdom" and rest.split(".")[0] in NAMES else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        module = import_module(spec.name.removeprefix("rhabdom."))
        spec.loader_state = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Restore the module's original spec, which the import system has just replaced.

        The module does not have to be executed, because its original import has already done so.
        """
        spec = module.__spec__
        assert spec is not None
        module.__spec__ = spec.loader_state
