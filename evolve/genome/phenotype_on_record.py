"""Checks of a phenotype that was read from a file.

Each field must have the right type, and a value in the valid range of the gene that determines the field. Some fields
determine the sizes of an animal's arrays. All fields are therefore checked before the animal is built.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import isqrt
from typing import Any

from evolve.genome.genes import ALL_GENES, FACETS, LAMBDA_MAX, OPTIONAL, RELIEF_POINTS, TILT
from evolve.genome.interval import Interval
from evolve.genome.plain_values import listed, real, whole_number

__all__ = ["checked_fields"]

SIDES = ("resolution_height", "resolution_width")
SEEN_THROUGH = ("relative_aperture", "relief", "refractive_index")
LARGEST_COUNT = 4096  # largest allowed count in a field that has no gene


def checked_fields(record: Any, names: Iterable[str]) -> dict[str, Any]:
    """Return the fields of a phenotype by name, converted to the types of `Phenotype`.

    names: names of all fields; a record may lack some of them

    Raises:
        ValueError: the record is not a mapping, a field is unknown, has another type or lies outside its range, or only
            some of the fields of a pupil or of facets are None. The message names the field.
    """
    if not isinstance(record, Mapping):
        raise ValueError("phenotype: must be a table of its fields")
    if unknown := sorted(set(record) - set(names)):
        raise ValueError(f"phenotype.{unknown[0][:40]}: unknown")
    fields = {name: _checked(name, value) for name, value in record.items()}
    if len({fields.get(name) is None for name in SEEN_THROUGH}) > 1:
        raise ValueError(f"phenotype: {', '.join(SEEN_THROUGH)} must all be null, or none of them")
    if len({fields.get(name) is None for name in FACETS}) > 1:
        raise ValueError(f"phenotype: {', '.join(FACETS)} must all be null, or none of them")
    return fields


def _checked(name: str, value: Any) -> Any:
    key = f"phenotype.{name}"
    if value is None and name in (*SEEN_THROUGH, "lambda_max_nm", TILT, *OPTIONAL):
        return None
    if name == "resolution":
        sides = zip(SIDES, listed(value, key, 2, 2), strict=True)
        return tuple(_of_gene(side, f"phenotype.{side}", number) for side, number in sides)
    if name == "relief":
        points = tuple(
            _of_gene("doe_00", key, height) for height in listed(value, key, 1, int(RELIEF_POINTS.high) ** 2)
        )
        if isqrt(len(points)) ** 2 != len(points) or isqrt(len(points)) not in RELIEF_POINTS:
            raise ValueError(f"{key} has {len(points)} entries: must have N x N, N in {RELIEF_POINTS}")
        return points
    if name == "lambda_max_nm":
        peaks = zip(LAMBDA_MAX, listed(value, key, 1, len(LAMBDA_MAX)), strict=False)
        return tuple(_of_gene(gene, key, peak) for gene, peak in peaks)
    return _of_gene(name, key, value)


def _of_gene(gene: str, key: str, value: Any) -> float | int:
    """Return the value of a phenotype's field after a check against the valid range of a gene.

    If `gene` is not the name of a gene, as for the field "encoder", the value must be a whole number from 1 to 4,096.

    gene: name of the gene that determines the field, or of the field
    key: name of the field in messages

    Raises:
        ValueError: the value has another type or lies outside the range.
    """
    valid = ALL_GENES[gene].range if gene in ALL_GENES else Interval(1, LARGEST_COUNT)
    if gene not in ALL_GENES or ALL_GENES[gene].kind == "integer":
        return whole_number(value, key, int(valid.low), int(valid.high))
    return real(value, key, valid)
