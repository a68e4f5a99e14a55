"""`evolve config`: the settings of a run that has not started, and their valid ranges."""

from __future__ import annotations

import json
import math
from argparse import Namespace
from dataclasses import Field, fields
from typing import Any

from evolve.config.assemble import assemble, to_toml
from evolve.config.checks import ConfigError
from evolve.config.formats import FORMAT
from evolve.config.run_config import SECTIONS, TASKS, RunConfig
from evolve.config.task_code import LABEL
from evolve.genome.genes import ALL_GENES, GENES, Gene
from evolve.genome.interval import Interval
from evolve.runs.output import say

__all__ = ["config", "schema"]

KINDS = {"int": "integer", "float": "number", "bool": "boolean", "str": "string"}


def config(arguments: Namespace) -> int:
    """Print all settings of a run as TOML, or the schema of the settings as JSON."""
    if arguments.what == "schema":
        _refuse_for_schema(arguments)
        say(json.dumps(schema(), indent=1))
        return 0
    chosen = assemble(arguments.task, arguments.preset, arguments.config, arguments.set, scale=arguments.scale)
    say(to_toml(chosen), end="")
    return 0


def _refuse_for_schema(arguments: Namespace) -> None:
    """Refuse options that give settings a value, such as `--set`.

    They would have no effect, because the schema is the same for all runs.

    Raises:
        ConfigError: such an option was given.
    """
    values = {"TASK": arguments.task, "--config": arguments.config, "--set": arguments.set, "--scale": arguments.scale}
    values["--preset"] = arguments.preset != arguments.parser.get_default("preset")
    for name, given in values.items():
        if given:
            raise ConfigError(f"{name}: must be left out with schema, which describes the settings of all runs")


def schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a run's config.toml and of files for `--config`.

    The schema describes each setting separately. `evolve config show` also checks dependencies between settings.
    """
    top = {f.name: _setting(f) for f in fields(RunConfig) if f.name in ("seed", "workers", "task_sha256")}
    task = {"anyOf": [{"enum": list(TASKS)}, {"type": "string", "pattern": f"^{LABEL.pattern}$"}]}
    sections = {name: _object({f.name: _setting(f) for f in fields(cls)}) for name, cls in SECTIONS.items()}
    genome = _object({name: _gene(gene) for name, gene in ALL_GENES.items()}, closed=False)
    properties = {"format": {"const": FORMAT}, "task": task, **top, **sections, "genome": genome}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "rhabdom run", **_object(properties)}


def _object(properties: dict[str, Any], closed: bool = True) -> dict[str, Any]:
    return {"type": "object", "properties": properties, "additionalProperties": not closed}


def _setting(definition: Field[Any]) -> dict[str, Any]:
    """Return the schema of one setting: type, range, default and meaning."""
    kind = str(definition.type)
    found: dict[str, Any] = {"description": definition.metadata["meaning"], "default": definition.default}
    valid = definition.metadata["valid"]
    limits = {} if valid is None else _limits(valid)
    if kind == "float | str":
        return found | {"anyOf": [{"type": "number", **limits}, {"const": "auto"}]}
    return found | {"type": KINDS[kind], **limits}


def _limits(valid: Interval) -> dict[str, float]:
    """Return a range as keywords of a JSON schema. An unbounded range has no maximum."""
    least = {"exclusiveMinimum" if valid.open_low else "minimum": valid.low}
    return least | ({"maximum": valid.high} if math.isfinite(valid.high) else {})


def _gene(gene: Gene) -> dict[str, Any]:
    """Return the schema of a gene's settings."""
    kind = "integer" if gene.kind == "integer" else "number"
    value = {"type": kind, **_limits(gene.range)}
    default = GENES[gene.name].default if gene.name in GENES else gene.default
    return {"description": gene.meaning} | _object(
        {
            "open": {"type": "boolean", "default": default.open},
            "low": {**value, "default": default.low},
            "high": {**value, "default": default.high},
            "start": {**value, "default": default.start},
            "opens_at": {"type": "integer", "minimum": 0, "default": default.opens_at},
        }
    )
