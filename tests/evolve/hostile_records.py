"""Manipulated lines of a record: valid JSON or nearly, but with invalid content."""

import json

from tests.evolve.store.records import candidate

HUGE = "9" * 400

# Replacements for values of a valid line: field (dotted) -> its JSON text
VALUES = {
    "Infinity as an id": ("id", "Infinity"),
    "10**400 as an id": ("id", HUGE),
    "6,000 digits": ("seed", "7" * 6000),
    "text as an id": ("id", '"0"'),
    "a fraction as an id": ("id", "0.5"),
    "true as a seed": ("seed", "true"),
    "negative seed": ("seed", "-1"),
    "10**400 as fitness": ("fitness", HUGE),
    "1e400 as fitness": ("fitness", "1e400"),
    "NaN as fitness": ("fitness", "NaN"),
    "no fitness and no failure": ("fitness", "null"),
    "empty returns": ("returns", "[]"),
    "null among the returns": ("returns", "[1.0, null]"),
    "returns as text": ("returns", '"[1.0]"'),
    "success above 1": ("success_rate", "1.5"),
    "no success rate": ("success_rate", "null"),
    "negative steps": ("steps", "-4096"),
    "infinite seconds": ("seconds", "-Infinity"),
    "curve of one number": ("curve", "[[1]]"),
    "a number as failure": ("failure", "5"),
    "a policy that is no checksum": ("policy", '"</script>"'),
    "half a checksum": ("policy", f'"{"0f" * 16}"'),
    "a checksum and a line": ("policy", f'"{"0f" * 32}\\n"'),
    "parents of fractions": ("parents", "[0.5]"),
    "genome of text": ("genome", '["a"]'),
    "100,000 brackets": ("returns", "[" * 100_000 + "]" * 100_000),
    "eyes as a script": ("phenotype.n_eyes", '"<img src=x onerror=alert(1)>"'),
    "10**9 eyes": ("phenotype.n_eyes", "1000000000"),
    "no eyes": ("phenotype.n_eyes", "0"),
    "10**9 layers": ("phenotype.layers", "1000000000"),
    "20,000 neurons": ("phenotype.neurons", "20000"),
    "resolution of a million": ("phenotype.resolution", "[1000000, 1000000]"),
    "resolution of one number": ("phenotype.resolution", "[5]"),
    "resolution of zero": ("phenotype.resolution", "[0, 5]"),
    "memory of 10**400": ("phenotype.memory_frames", HUGE),
    "memory as a script": ("phenotype.memory_frames", '"</td><script>"'),
    "field of view of 400": ("phenotype.fov_deg", "400"),
    "field of view of NaN": ("phenotype.fov_deg", "NaN"),
    "field of view of null": ("phenotype.fov_deg", "null"),
    "relief of five": ("phenotype.relief", "[0.5, 0.5, 0.5, 0.5, 0.5]"),
    "relief of a mountain": ("phenotype.relief", json.dumps([1e300] * 16)),
    "no relief behind an aperture": ("phenotype.relief", "null"),
    "a shape that there is not": ("phenotype.aperture_shape", "99"),
    "negative dispersion": ("phenotype.dispersion", "-1"),
    "peaks in the infrared": ("phenotype.lambda_max_nm", "[5000]"),
    "a million peaks": ("phenotype.lambda_max_nm", json.dumps([500] * 1_000_000)),
    "unknown trait": ("phenotype.wings", "2"),
    "phenotype of a list": ("phenotype", "[]"),
    "phenotype of null": ("phenotype", "null"),
}


def line(field, value, identity=0):
    """Return a valid line with one value replaced."""
    record = json.loads(candidate(identity).to_line())
    place, _, trait = field.partition(".")
    if trait:
        record[place][trait] = "@"
    else:
        record[place] = "@"
    return json.dumps(record).replace('"@"', value, 1) + "\n"
