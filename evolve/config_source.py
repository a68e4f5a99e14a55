"""Where a run's configuration comes from: defaults, preset, task, TOML file, `--set key=value`; later ones win."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields, replace
from functools import reduce
from importlib import resources
from pathlib import Path
from typing import Any

from evolve.config import SECTIONS, TASKS, ConfigError, RunConfig, check_gene_value, check_value
from evolve.genotype import CLUSTERS, GENES, GeneConfig, group_members

__all__ = ["assemble", "from_toml", "nearest", "parse_assignment", "preset_names", "read_toml", "to_toml"]

Tree = dict[str, Any]
GENE_FIELDS = tuple(f.name for f in fields(GeneConfig))
TOP_LEVEL = ("task", "seed", "workers")
# A maze's walls say the same at every height, so navigators' eyes are one row of receptors unless told otherwise.
TASK_TREES: Mapping[str, Tree] = {
    "navigation": {"genome": {"resolution_height": {"open": False, "low": 1.0, "high": 1.0, "start": 1.0}}}
}


def assemble(
    task: str | None = None, preset: str | None = None, file: Path | None = None, assignments: Iterable[str] = ()
) -> RunConfig:
    """A run's configuration from all its sources; `task` and `assignments` ("search.population=8") win.

    Raises:
        ConfigError: unknown key, wrong type, value out of range, contradiction, unreadable file.
    """
    layers: list[Tree] = []
    if file is not None:
        layers.append(_checked_tree(read_toml(file), str(file)))
    layers += [_checked_tree(parse_assignment(text), "--set") for text in assignments]
    if task is not None:
        layers.append(_checked_tree({"task": task}, ""))
    asked: Tree = reduce(_merge, layers, {})
    if "task" not in asked:
        raise ConfigError(f"task: missing; must be one of {', '.join(TASKS)}")
    below = [_checked_tree(_preset_tree(preset), f"preset {preset}")] if preset else []
    return _build(reduce(_merge, [*below, TASK_TREES.get(asked["task"], {}), asked], {}))


def from_toml(path: Path) -> RunConfig:
    """Configuration written by `to_toml`, which has every default written out."""
    return assemble(file=path)


def to_toml(config: RunConfig) -> str:
    """TOML text with every setting; `from_toml` reads it back equal."""
    import tomli_w

    tree = asdict(config)
    for name, use in tree["genome"].items():
        if GENES[name].kind == "integer":
            use.update({key: int(use[key]) for key in ("low", "high", "start")})
    return tomli_w.dumps(tree)


def read_toml(path: Path) -> Tree:
    """A TOML file's content; raises ConfigError naming file and line."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not UTF-8 text") from error
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: is not valid TOML: {error}") from error


def parse_assignment(text: str) -> Tree:
    """{"search": {"population": 8}} from "search.population=8"; the value is TOML, a bare word is text."""
    key, equals, value = (part.strip() for part in text.partition("="))
    parts = key.split(".")
    if not equals or not all(parts) or not value:
        raise ConfigError(f"--set {text!r}: must look like section.key=value")
    try:
        leaf: Any = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        leaf = value
    return reduce(lambda inner, part: {part: inner}, reversed(parts), leaf)


def preset_names() -> list[str]:
    """Names that `preset` takes."""
    folder = resources.files("evolve") / "presets"
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def nearest(word: str, known: Iterable[str]) -> str:
    """ "; did you mean X?" where a known word is near, else the list of them."""
    known = list(known)
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f"did you mean {close[0]!r}?" if close else f"known: {', '.join(known)}"


def _preset_tree(name: str) -> Tree:
    if name not in preset_names():
        raise ConfigError(f"unknown preset {name!r}; {nearest(name, preset_names())}")
    return tomllib.loads((resources.files("evolve") / "presets" / f"{name}.toml").read_text(encoding="utf-8"))


def _checked_tree(tree: Tree, source: str) -> Tree:
    """`tree`, every key known, every value in range, gene groups spelled out; else a ConfigError naming `source`."""
    try:
        return {key: _checked_entry(key, value) for key, value in tree.items()}
    except ConfigError as error:
        raise ConfigError(f"{source}: {error}" if source else str(error)) from None


def _checked_entry(key: str, value: Any) -> Any:
    if key == "task":
        if not isinstance(value, str) or value not in TASKS:
            raise ConfigError(f"unknown task {str(value)!r}; {nearest(str(value), TASKS)}")
        return value
    if key in TOP_LEVEL:
        return check_value(RunConfig, key, value, key)
    if key not in (*SECTIONS, "genome"):
        raise ConfigError(f"unknown key {key!r}; {nearest(key, (*TOP_LEVEL, *SECTIONS, 'genome'))}")
    if not isinstance(value, dict):
        raise ConfigError(f"{key} = {value!r}: is a section; set {key}.NAME")
    if key == "genome":
        return _checked_genome(value)
    names = [f.name for f in fields(SECTIONS[key])]
    for name in value:
        if name not in names:
            raise ConfigError(f"unknown key '{key}.{name}'; {nearest(name, names)}")
    return {name: check_value(SECTIONS[key], name, leaf, f"{key}.{name}") for name, leaf in value.items()}


def _checked_genome(section: Tree) -> Tree:
    """Per-gene settings; a cluster's name or "doe" stands for its genes, and the narrower name wins."""
    result: Tree = {}
    for group in sorted(section, key=lambda name: -len(group_members(name))):
        members, use = group_members(group), section[group]
        if not members:
            raise ConfigError(f"unknown gene {group!r}; {nearest(group, (*GENES, *CLUSTERS, 'doe'))}")
        if not isinstance(use, dict):
            raise ConfigError(f"genome.{group} = {use!r}: set genome.{group}.open, .low, .high or .start")
        for name in use:
            if name not in GENE_FIELDS:
                raise ConfigError(f"unknown key 'genome.{group}.{name}'; {nearest(name, GENE_FIELDS)}")
        for gene in members:
            checked = {k: check_gene_value(GENES[gene], k, v, f"genome.{group}.{k}") for k, v in use.items()}
            result[gene] = {**result.get(gene, {}), **checked}
    return result


def _merge(below: Tree, above: Tree) -> Tree:
    """Both trees; where they meet, `above` wins."""
    merged = dict(below)
    for key, value in above.items():
        under = merged.get(key)
        merged[key] = _merge(under, value) if isinstance(under, dict) and isinstance(value, dict) else value
    return merged


def _build(tree: Tree) -> RunConfig:
    """RunConfig from a checked tree, defaults filled in."""
    sections = {name: cls(**tree.get(name, {})) for name, cls in SECTIONS.items()}
    genes = tree.get("genome", {})
    genome = {}
    for name, gene in GENES.items():
        # With optics off the optical genes are frozen, unless someone asks for the contradiction in so many words.
        off = gene.cluster == "optical" and not sections["eye"].optics
        genome[name] = replace(gene.default, **{**({"open": False} if off else {}), **genes.get(name, {})})
    top = {name: tree[name] for name in TOP_LEVEL if name in tree}
    return RunConfig(**top, **sections, genome=genome)
