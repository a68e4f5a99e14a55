"""Records that tests write by hand, with valid checksums."""

import json

from evolve.store.chain import sealed_record, without_checksum


def records_of(path):
    """Return the lines of a record as dictionaries, without checksums."""
    return [json.loads(without_checksum(line)) for line in path.read_bytes().splitlines()]


def write_records(path, records):
    """Write dictionaries as the lines of a record."""
    path.write_bytes(sealed_record(json.dumps(record) + "\n" for record in records))
