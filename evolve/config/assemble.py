"""Assembly of a run's configuration from all sources of settings.

The sources are the defaults, the preset, the preset's settings for shorter or longer runs (its scale), the task's
default settings, a TOML file, an animal of another run, and `--set key=value`, in this order. Later sources override
earlier ones. There is one exception: a preset that was made for this task overrides the settings of the task.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, fields, replace
from functools import reduce
from pathlib import Path
from typing import Any

from evolve.config.checks import check_gene_value, check_value, suggestion
from evolve.config.formats import FORMAT, OLDEST_CONTINUED, format_of, in_own_axes, upgraded
from evolve.config.provenance import Source
from evolve.config.relief_starts import no_such_gene, with_relief
from evolve.config.run_config import SECTIONS, TASKS, ConfigError, EyeConfig, RunConfig
from evolve.config.sources import parsed_toml, preset_sources, read_assignment, read_toml, task_defaults
from evolve.config.square_eyes import no_such_side, with_square_eyes
from evolve.config.task_card import TaskCard, card_of
from evolve.config.task_choice import TaskChoice
from evolve.config.task_code import TaskCode, names_code
from evolve.genome.genes import (
    ALL_GENES,
    CLUSTERS,
    FACETS,
    FAMILIES,
    GENES,
    RHABDOM,
    SIDE,
    SIDES,
    TIME_CONSTANT,
    VERTICAL,
    GeneConfig,
    group_members,
)

__all__ = ["assemble", "from_text", "from_toml", "to_toml"]

Tree = dict[str, Any]
# Genes that exist only with a certain setting. For each gene: the kind of eyes, the setting and its value.
OF_SETTINGS = {
    RHABDOM: ("with rhabdoms", "eye.rhabdoms", "true"),
    VERTICAL: ("whose height evolves", "eye.vertical_fov", "gene"),
    TIME_CONSTANT: ("whose receptors have memory", "eye.temporal_order", "1"),
    **dict.fromkeys(FACETS, ("that are compound eyes", "eye.compound", "true")),
}
GENE_FIELDS = tuple(f.name for f in fields(GeneConfig))
TOP_LEVEL = ("task", "seed", "workers", "task_sha256")
SETTINGS = (*TOP_LEVEL, *(f"{section}.{f.name}" for section, cls in SECTIONS.items() for f in fields(cls)))


def assemble(
    task: str | None = None,
    preset: str | None = None,
    file: Path | None = None,
    assignments: Iterable[str] = (),
    starts: Source | None = None,
    scale: str | None = None,
) -> RunConfig:
    """Return a run's configuration, assembled from all sources. Settings without a source have their default values.

    task: name of a built-in task, or FILE.py:CLASS; it overrides the other sources. None: the task that the preset, the
        file or an assignment names
    preset: name of a preset; None: no preset
    file: TOML file with settings; None: no file
    assignments: settings such as "search.population=8"
    starts: start values of the genes, which `evolve.runs.start_from` reads from another run; None: no other run
    scale: "laptop" or "paper", only for a preset that has several scales; None: "laptop" for such a preset

    Raises:
        ConfigError: no source names a task; or a task, preset, scale or key is unknown; or a value has the wrong type
            or is out of range; or settings contradict each other; or a file cannot be read. The message is one line
            that names the key, the value, the allowed values, and the location of the setting.
    """
    choice = None if task is None else TaskChoice.named(task)
    code = None if choice is None else choice.code
    above = [_user_settings(read_toml(file), code)] if file is not None else []
    if starts is not None:
        above.append(starts)
    above += [_user_settings(read_assignment(text), code) for text in assignments]
    if choice is not None:
        above.append(Source("", dict(choice.settings)))
    return replace(_assembled(preset_sources(preset, scale), above), code=code)


def _assembled(below: list[Source], above: list[Source]) -> RunConfig:
    """Return the configuration that follows from default settings of the task and from other sources of settings.

    below: sources of a preset
    above: other sources, such as files and options; they override the preset and the default settings of the task
    """
    known_task = [source.tree["task"] for source in (*below, *above) if "task" in source.tree]
    if not known_task:
        raise ConfigError(f"task: missing; must be one of {', '.join(TASKS)}")
    of_task = task_defaults(known_task[-1])
    # A preset for this task overrides the task's settings, but they override a general preset.
    made_for_it = any(source.tree.get("task") == known_task[-1] for source in below)
    layers = [of_task, *below, *above] if made_for_it else [*below, of_task, *above]
    trees = [_checked(source) for source in layers]
    try:
        return _build(trees, layers)
    except ConfigError as error:
        raise ConfigError(f"{error}{_blamed(error, layers)}", *error.keys) from None


def from_toml(path: Path) -> RunConfig:
    """Return the configuration from a file that `to_toml` wrote, in the current format or an older one.

    Raises:
        ConfigError: the file cannot be read, or a setting is invalid; see `assemble`.
    """
    return _read_back(read_toml(path))


def from_text(text: bytes | str, name: str = "config.toml") -> RunConfig:
    """Return the configuration from TOML text that `to_toml` wrote, in the current format or an older one.

    name: name of the text in error messages

    Raises:
        ConfigError: the text is not valid TOML, or a setting is invalid; see `assemble`.
    """
    return _read_back(parsed_toml(text, name))


def _read_back(written: Source) -> RunConfig:
    """Return a stored configuration. Default settings are used only where the file lacks a setting."""
    return _assembled([], [replace(written, tree=upgraded(written.tree))])


def _user_settings(source: Source, code: TaskCode | None) -> Source:
    """Return the settings from a source of the user: either a file or an option `--set`.

    A file may be the config.toml of another run. It must then have format 2 or a later one, because settings of format
    1 can have another meaning. Neither source can select a user task, whose code is executed: the user must name the
    task on the command line or in a Python call.
    """
    if names_code(source.tree.get("task")) and code is None:
        raise ConfigError(
            f"{source.name}: task = {source.tree['task']!r}: a file cannot name code; use evolve run FILE.py:CLASS",
            "task",
        )
    number = format_of(source.tree) if "format" in source.tree else FORMAT
    if number < OLDEST_CONTINUED:
        raise ConfigError(f"{source.name}: format = {number}: must be {OLDEST_CONTINUED} to {FORMAT}", "format")
    known = ("format", "task", "task_sha256") if code else ("format",)
    tree = {key: value for key, value in source.tree.items() if key not in known}
    return replace(source, tree=in_own_axes(tree, number))


def to_toml(config: RunConfig) -> str:
    """Return TOML text with all settings. `from_toml` restores an equal configuration from a file with this text."""
    import tomli_w

    tree = {"format": FORMAT, **asdict(replace(config, code=None))}
    del tree["code"]
    if not config.task_sha256:
        del tree["task_sha256"]
    for name, use in tree["genome"].items():
        if ALL_GENES[name].kind == "integer":
            use.update({key: int(use[key]) for key in ("low", "high", "start")})
    return tomli_w.dumps(tree)


def _checked(source: Source) -> Tree:
    """Return the checked settings of a source, such as a file. Settings of a group are copied to each of its genes.

    Raises:
        ConfigError: a key or a value is invalid; the message names the source and, if known, the line.
    """
    try:
        return {key: _checked_entry(key, value) for key, value in source.tree.items()}
    except ConfigError as error:
        places = [place for key in error.keys if (place := source.place(key))] or [source.name]
        name = "--set" if places[0].startswith("--set") else places[0]
        raise ConfigError(f"{name}: {error}" if name else str(error), *error.keys) from None


def _blamed(error: ConfigError, layers: Iterable[Source]) -> str:
    """Return the locations of the settings that cause an error, as text such as " (mine.toml, line 3; --set ...)".

    If several sources contain a setting, its location is in the source that overrides the others.
    """
    effective = [next((at for s in reversed(list(layers)) if (at := s.place(key))), None) for key in error.keys]
    places = list(dict.fromkeys(place for place in effective if place))
    return f" ({'; '.join(places)})" if places else ""


def _checked_entry(key: str, value: Any) -> Any:
    if key == "task":
        if card_of(value) is None:
            raise ConfigError(f"unknown task {str(value)!r}; {suggestion(str(value), TASKS)}", key)
        return value
    if key in TOP_LEVEL:
        return check_value(RunConfig, key, value, key)
    if key not in (*SECTIONS, "genome"):
        known = (*TOP_LEVEL, *SECTIONS, "genome") if isinstance(value, dict) else SETTINGS
        raise ConfigError(f"unknown key {key!r}; {suggestion(key, known)}", key)
    if not isinstance(value, dict):
        raise ConfigError(f"{key} = {value!r}: is a section; set {key}.NAME", key)
    if key == "genome":
        return _checked_genome(value)
    names = [f.name for f in fields(SECTIONS[key])]
    for name in value:
        if name not in names:
            hint = suggestion(name, names)
            hint = hint if hint.startswith("did") else suggestion(name, SETTINGS)
            raise ConfigError(f"unknown key '{key}.{name}'; {hint}", f"{key}.{name}")
    return {name: check_value(SECTIONS[key], name, leaf, f"{key}.{name}") for name, leaf in value.items()}


def _checked_genome(section: Tree) -> Tree:
    """Return the checked settings of each gene. Settings of a smaller group of genes override those of a larger one."""
    result: Tree = {}
    for group in sorted(section, key=lambda name: -len(group_members(name))):
        key, members, use = f"genome.{group}", group_members(group), section[group]
        if not members:
            raise ConfigError(
                f"unknown gene {group!r}; {suggestion(group, (*GENES, SIDE, *OF_SETTINGS, *CLUSTERS, *FAMILIES))}", key
            )
        if not isinstance(use, dict):
            raise ConfigError(f"{key} = {use!r}: set {key}.open, .low, .high, .start or .opens_at", key)
        for name in use:
            if name not in GENE_FIELDS:
                raise ConfigError(f"unknown key '{key}.{name}'; {suggestion(name, GENE_FIELDS)}", f"{key}.{name}")
        for gene in members:
            checked = {k: check_gene_value(ALL_GENES[gene], k, v, f"{key}.{k}") for k, v in use.items()}
            result[gene] = {**result.get(gene, {}), **checked}
    return result


def _merged(trees: Iterable[Tree]) -> Tree:
    """Return one tree with the settings of all trees; later trees override earlier ones."""
    empty: Tree = {}
    return reduce(_merge, trees, empty)


def _merge(below: Tree, above: Tree) -> Tree:
    """Return one tree with the settings of both trees; values in `above` override those in `below`."""
    merged = dict(below)
    for key, value in above.items():
        under = merged.get(key)
        merged[key] = _merge(under, value) if isinstance(under, dict) and isinstance(value, dict) else value
    return merged


def _require_genes(source: Source, eye: EyeConfig, card: TaskCard) -> None:
    """Check that animals with these eyes can have all genes that a source, such as a file, names individually.

    Settings of a group of genes, such as `genome.optical`, are not checked: they apply to those genes that exist.

    Raises:
        ConfigError: a gene does not exist for these eyes or in this task.
    """
    for name in with_relief(source.tree, eye).get("genome", {}):
        if name in (SIDE, *SIDES) and name not in eye.genes:
            raise ConfigError(no_such_side(name, eye), f"genome.{name}", "eye.square")
        if name in OF_SETTINGS and name not in eye.genes:
            kind, key, value = OF_SETTINGS[name]
            raise ConfigError(
                f"genome.{name}: only eyes {kind} have this gene; set {key} = {value}", f"genome.{name}", key
            )
        if not card.has_gene(name):
            raise ConfigError(
                f"genome.{name}: is for user tasks; in built-in tasks eyes look along the floor",
                *(f"genome.{name}", "task"),
            )
        if eye.compound and name in ALL_GENES and name not in eye.genes:
            raise ConfigError(
                f"genome.{name}: compound eyes have facets instead of a pupil; set eye.compound = false",
                *(f"genome.{name}", "eye.compound"),
            )
        if name in ALL_GENES and name not in eye.genes:
            raise ConfigError(no_such_gene(name, eye), f"genome.{name}", "eye.relief_points", "eye.relief_symmetric")


def _build(trees: list[Tree], layers: list[Source]) -> RunConfig:
    """Return the configuration from `trees`, the checked settings of each source; later trees override earlier ones."""
    merged = _merged(trees)
    eye, card = EyeConfig(**merged.get("eye", {})), card_of(merged["task"])
    assert card is not None  # guaranteed by `_checked`
    table = {name: gene for name, gene in eye.genes.items() if card.has_gene(name)}
    layers = [with_square_eyes(source, eye) for source in layers]
    for source in layers:
        _require_genes(source, eye, card)
    tree = _merged([with_relief(_checked(source), eye) for source in layers])
    sections = {name: cls(**tree.get(name, {})) for name, cls in SECTIONS.items()}
    genes = tree.get("genome", {})
    genome = {}
    for name, gene in table.items():
        # If optics is off, the optical genes are frozen, unless a setting explicitly opens one of them.
        off = gene.cluster == "optical" and not sections["eye"].optics
        genome[name] = replace(gene.default, **{**({"open": False} if off else {}), **genes.get(name, {})})
    top = {name: tree[name] for name in TOP_LEVEL if name in tree}
    return RunConfig(**top, **sections, genome=genome)
