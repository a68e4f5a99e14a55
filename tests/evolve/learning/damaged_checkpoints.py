"""Changes to a checkpoint file, each of which would lead to another record or to a failed candidate.

Every function takes the bytes of a file and a random generator, and returns other bytes. The checksum in the file stays
as it was, or is computed again where the name says so.
"""

import json

import safetensors.torch
import torch

from evolve.learning.checkpoint_file import BLANK, ENTRY, metadata_of, sealed


def changed(content, numbers=None, tensors=None, checksum=False):
    """Return a file after changes to its numbers and tensors.

    numbers, tensors: functions that return the changed dictionary
    checksum: True to compute the checksum again, so that it fits the changes
    """
    old = json.loads(metadata_of(content)[ENTRY])
    new = numbers(dict(old)) if numbers else old
    held = safetensors.torch.load(content)
    held = tensors(held) if tensors else held
    if not checksum:
        return safetensors.torch.save(held, {ENTRY: json.dumps(new)})
    return sealed(safetensors.torch.save(held, {ENTRY: json.dumps({**new, "sha256": BLANK})}))


def flipped_bit(content, chance):
    at = chance.randrange(8 * len(content))
    other = bytearray(content)
    other[at // 8] ^= 1 << at % 8
    return bytes(other)


def cut(content, chance):
    return content[: chance.randrange(len(content))]


def zero_bytes(content, chance):
    return b"\0" * len(content)


def number(key, value):
    return lambda content, chance: changed(content, lambda n: {**n, key: value(n[key])})


def zero_tensors(content, chance):
    return changed(content, tensors=lambda held: {name: torch.zeros_like(value) for name, value in held.items()})


def one_element(content, chance):
    def other(held):
        name = chance.choice(sorted(held))
        held[name] = held[name].clone()
        held[name].view(-1)[chance.randrange(held[name].numel())] += 1
        return held

    return changed(content, tensors=other)


def without(held, chance):
    del held[chance.choice(sorted(held))]
    return held


def other_shape(held, chance):
    name = chance.choice(sorted(held))
    return {**held, name: torch.cat([held[name].reshape(-1), torch.ones(1)])}


def foreign(held, chance):
    return {**held, f"now/{chance.random()}": torch.ones(2)}


def with_tensors(change, checksum):
    return lambda content, chance: changed(content, tensors=lambda held: change(held, chance), checksum=checksum)


def without_checksum(content, chance):
    """Return the form of former versions."""
    return changed(content, lambda n: {key: value for key, value in n.items() if key not in ("owner", "sha256")})


def without_numbers(content, chance):
    return changed(content, lambda n: {"owner": n["owner"], "sha256": n["sha256"]}, checksum=True)


def impossible(key, value):
    return lambda content, chance: changed(content, lambda n: {**n, key: value(n[key])}, checksum=True)


def pickle(content, chance):
    return b"cos\nsystem\n(S'touch owned'\ntR."


DAMAGES = {
    "a flipped bit": flipped_bit,
    "half a file": cut,
    "zeros": zero_bytes,
    "a pickle": pickle,
    "nothing": lambda content, chance: b"",
    "steps of 0": number("steps", lambda steps: 0),
    "10**9 steps": number("steps", lambda steps: 10**9),
    "a negative unit": number("unit", lambda unit: -unit),
    "a reversed curve": number("curve", lambda curve: [[steps, -value] for steps, value in reversed(curve)]),
    "Adam's steps": number("adam_steps", lambda steps: steps + 1),
    "zero tensors": zero_tensors,
    "one element": one_element,
    "a missing tensor": with_tensors(without, checksum=False),
    "a missing tensor, with a checksum": with_tensors(without, checksum=True),
    "a wrong shape": with_tensors(other_shape, checksum=False),
    "a misshapen tensor, with a checksum": with_tensors(other_shape, checksum=True),
    "a foreign tensor, with a checksum": with_tensors(foreign, checksum=True),
    "no checksum": without_checksum,
    "no numbers, with a checksum": without_numbers,
    "steps of 0, with a checksum": impossible("steps", lambda steps: 0),
    "a negative unit, with a checksum": impossible("unit", lambda unit: -unit),
}
