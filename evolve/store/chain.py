"""Checksums of the lines of a record. Each checksum is chained to the line before, as in a write-ahead log.

A line is a JSON object whose last field is its checksum: 16 hexadecimal digits of BLAKE2b over the previous checksum
and the line without this field. If a line is changed, inserted, moved, or removed from the middle, a checksum at this
place or at the next line does not match. The probability that accidental damage is overlooked is 2^-64. The removal of
the last lines is not noticed. Records written by older versions of rhabdom have no checksums. If such a run is
continued, the chain starts with the first new line, whose checksum also covers all earlier lines.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from dataclasses import dataclass

__all__ = ["Chain", "sealed_record", "without_checksum"]

BYTES = 8  # size of a checksum
FIELD = b', "checksum": "'
REST = re.compile(rb'[0-9a-f]{%d}"\}' % (2 * BYTES))


@dataclass(frozen=True)
class Chain:
    """State of the checksums after some lines of a record.

    last: checksum after these lines; b"" before the first line
    unchecked: number of lines without a checksum, which precede all others
    begun: True if a line had a checksum
    """

    last: bytes = b""
    unchecked: int = 0
    begun: bool = False

    def sealed(self, line: bytes) -> bytes:
        """Return the next line, a JSON object, with its checksum added. The result ends with a line feed."""
        body = line.removesuffix(b"\n")
        return body[:-1] + FIELD + self._next(body) + b'"}\n'

    def after(self, line: bytes) -> Chain:
        """Return the state of the checksums after one more line. The line may end with a line feed.

        Raises:
            ValueError: the checksum of the line does not match, or is missing although an earlier line has one.
        """
        body, checksum = _split(line.removesuffix(b"\n"))
        due = self._next(body)
        if checksum is None and self.begun:
            raise ValueError("it has no checksum, although earlier lines have one")
        if checksum is None:
            return Chain(due, self.unchecked + 1)
        if checksum != due:
            also = f" and the {self.unchecked} lines before it, which have none" if not self.begun else ""
            raise ValueError(f"its checksum does not match the line{also if self.unchecked else ''}")
        return Chain(due, self.unchecked, begun=True)

    def _next(self, body: bytes) -> bytes:
        return hashlib.blake2b(self.last + body, digest_size=BYTES).hexdigest().encode()


def sealed_record(lines: Iterable[str]) -> bytes:
    """Return the content of a record that consists of these lines, each with its checksum."""
    content, chain = [], Chain()
    for line in lines:
        content.append(chain.sealed(line.encode()))
        chain = chain.after(content[-1])
    return b"".join(content)


def without_checksum(line: bytes) -> bytes:
    """Return a line of a record without its checksum and its line feed."""
    return _split(line.removesuffix(b"\n"))[0]


def _split(line: bytes) -> tuple[bytes, bytes | None]:
    """Return a line without its checksum, and the checksum, which is None if the line has none.

    A line is a JSON object, and its last field "checksum" is found by its name in quotation marks. JSON escapes
    quotation marks within strings, so a string of another field cannot be mistaken for this name.
    """
    body, field, rest = line.rpartition(FIELD)
    if not field or REST.fullmatch(rest) is None:
        return line, None
    return body + b"}", rest[: 2 * BYTES]
