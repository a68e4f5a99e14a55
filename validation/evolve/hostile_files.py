"""Trials of validation/evolve/hostile.py: untrusted pages, policies, images and models."""

from __future__ import annotations

import json
import random
import time
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import torch
from safetensors.torch import save

import sim
from evolve.learning.policy import PolicyConfig, build_policy, learnt, load_policy, save_policy
from evolve.report import tables
from evolve.report.markup import document
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from sim.exr.files import ExrError
from sim.scene.source import load
from validation.evolve.hostile_runs import TEXTS, Stage

EXPECTED = {
    *("html", "head", "meta", "title", "style", "body", "div", "table", "thead", "tbody", "tr", "th", "td", "h3")
}
EXPECTED |= {*("dl", "dt", "dd", "dfn", "small", "details", "summary", "pre")}
MARKUP = "<>\"'&/= \x00\x1b{}$-;"


class _Tags(HTMLParser):
    """Parser for the elements and attributes that a browser would find in a page."""

    def __init__(self, content: str) -> None:
        super().__init__()
        self.found: set[str] = set()
        self.attributes: set[str] = set()
        self.feed(content)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.add(tag)
        self.attributes |= {name for name, _ in attrs}


def text_on_a_page(chance: random.Random, stage: Stage) -> str | None:
    """Put markup into a failure's text, the versions, and the run's name."""
    hostile = "".join(chance.choice((*TEXTS, *MARKUP)) for _ in range(6))
    run = Run.open(stage.copy("run" + hostile.replace("/", "-").replace("\x00", "")[:60]))
    failed = replace(run.candidates[-1], id=6, generation=1, index=2, failure=hostile)
    run.append(Candidate.from_line(failed.to_line()))
    versions = json.dumps([{"versions": {hostile: hostile, "commit": hostile}}])
    (run.path / "versions.json").write_text(versions)
    parts = tables.headline(run) + tables.all_candidates(run) + tables.failures(run) + tables.run_facts(run)
    tags = _Tags(document(run.path.name, parts).decode())
    unwanted = (tags.found - EXPECTED) | {name for name in tags.attributes if name.startswith("on") or name == "style"}
    return f"{hostile!r} became {unwanted}" if unwanted else None


def _in_time(read: Callable[[], object], refusals: tuple[type[Exception], ...], must: bool) -> str | None:
    began = time.process_time()
    try:
        read()
        wrong = "was read without an error" if must else None
    except refusals as error:
        wrong = None if "\n" not in str(error) else f"said {str(error)!r}"
    except Exception as error:
        wrong = f"{type(error).__name__}: {error}"
    took = time.process_time() - began
    return wrong or (f"took {took:.1f} s" if took > 1.0 else None)


def forged_policy(chance: random.Random, stage: Stage) -> str | None:
    """Give a policy a shape that differs from its tensors, or damaged bytes."""
    path = stage.folder / "policy.safetensors"
    policy = build_policy(PolicyConfig((2, 2, 3, 2, 2), 8))
    save_policy(policy, path)
    load_policy(path)  # loads PyTorch's lazy modules, which takes a second
    forged = chance.random() < 0.5
    if forged:
        shape = {"eyes": [2, 2, 3, 2, 2], "neurons": 8, "layers": 2}
        wrong = chance.choice((20_000, 10**9, 10**400, -1, 0, 1e400, "8", None, [8], {}))
        key = chance.choice(("neurons", "layers", "eyes"))
        shape[key] = [wrong] * 5 if key == "eyes" else wrong
        metadata = {"config": json.dumps({**shape, "units": "LeakyReLU"})}
        path.write_bytes(save({name: tensor.detach().clone() for name, tensor in learnt(policy).items()}, metadata))
    else:
        content = bytearray(path.read_bytes())
        for _ in range(chance.randint(1, 4)):
            content[chance.randrange(min(2000, len(content)))] = chance.randrange(256)
        path.write_bytes(content[: chance.choice((len(content), chance.randrange(len(content))))])
    meant = forged and wrong == "8" and key != "eyes"  # text that is a valid number
    with torch.random.fork_rng():
        return _in_time(lambda: load_policy(path), (ValueError,), must=forged and not meant)


def broken_picture(chance: random.Random, stage: Stage) -> str | None:
    """Flip bytes of an EXR file, or truncate it: the images must be unchanged, or ExrError raised."""
    path = stage.folder / "views.exr"
    if not path.exists():
        noise = np.random.default_rng(0)
        view = sim.View("left", np.array([450.0, 550.0]), noise.random((2, 5, 6), dtype=np.float32))
        sim.write_exr(path, [view, replace(view, name="right")])
    content = bytearray(path.read_bytes())
    for _ in range(chance.randint(1, 3)):
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    spoilt = stage.folder / "spoilt.exr"
    spoilt.write_bytes(content[: chance.choice((len(content), chance.randrange(len(content))))])
    whole = sim.read_exr(path)

    def read() -> None:
        views = sim.read_exr(spoilt)
        if any(not np.array_equal(a.radiance, b.radiance) for a, b in zip(views, whole, strict=True)):
            raise AssertionError("the images differ from those that were written")

    return _in_time(read, (ExrError,), must=False)


def bomb_of_a_model(chance: random.Random, stage: Stage) -> str | None:
    """Put excessive copies, cells and positions into an MJCF model."""
    many = chance.choice((10**5, 10**6, 10**9, "1" + "0" * 400))
    geom = "<geom name='ball' size='1'/>"
    inside, asset = chance.choice(
        (
            (f"<replicate count='{many}'>{geom}</replicate>", ""),
            ("<replicate count='150'>" * 3 + geom + "</replicate>" * 3, ""),
            (geom, f"<hfield name='land' nrow='{many}' ncol='{many}' size='1 1 1 1'/>"),
            (f"<geom size='1' pos='{chance.choice(('inf', 'nan', '-inf', '1e999'))} 0 0'/>", ""),
            ("<geom size='inf'/>", ""),
        )
    )
    text = f"<mujoco><asset>{asset}</asset><worldbody>{inside}</worldbody></mujoco>"
    return _in_time(lambda: load(text), (ValueError,), must=True)
