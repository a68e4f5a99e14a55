"""Make the shipped run, which `evolve demo` shows, from a finished run of the quick preset:

    evolve run detection --preset quick --seed N --out runs/shipped
    python -m experiments.shipped_run runs/shipped

The whole record is copied, with the policy of the best animal, which replay, report and EXR files need. The other
policies would take megabytes; their hashes are removed from the record.
"""

from __future__ import annotations

import argparse
import json
import shutil
from dataclasses import replace
from pathlib import Path

import evolve
from evolve.config.assemble import to_toml
from evolve.search.successive_halving import finished
from evolve.store.chain import sealed_record
from evolve.store.directory import Run

FOLDER = Path(evolve.__file__).parent / "demo"


def ship(source: Path, folder: Path = FOLDER) -> Run:
    """Write a finished run with only the best animal's policy as the shipped run.

    Raises:
        ValueError: the run is not finished, or no candidate has succeeded.
    """
    run = Run.open(source)
    if not finished(run) or run.best is None:
        raise ValueError(f"{source}: must be a finished run with a candidate that has not failed")
    best = run.best.id
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "policies").mkdir(parents=True)
    (folder / "config.toml").write_text(to_toml(replace(run.config, workers=0)), encoding="utf-8")
    starts = json.loads((source / "versions.json").read_text(encoding="utf-8"))
    for start in starts:
        start.pop("config", None)  # the checksum of the source's config.toml
    (folder / "versions.json").write_text(json.dumps(starts, indent=1), encoding="utf-8")
    kept = [one if one.id == best else replace(one, policy=None) for one in run.in_order_of_finish]
    (folder / "candidates.jsonl").write_bytes(sealed_record(one.to_line() for one in kept))
    shutil.copyfile(run.policy_path(best), folder / "policies" / run.policy_path(best).name)
    return Run.open(folder)


def main() -> None:
    """Make the shipped run from the run that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path, help="directory of a finished run of the quick preset")
    print(ship(parser.parse_args().run))


if __name__ == "__main__":
    main()
