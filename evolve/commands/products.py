"""`evolve replay`, `report` and `export`: what can be made from a run."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from evolve.config import ConfigError
from evolve.store import Run, RunError
from optics import backend

__all__ = ["export", "replay", "report", "write_export", "write_report"]
