"""Tracking: the world of detection; its objects move."""

from __future__ import annotations

from sim.tasks.detection import add_layout

__all__ = ["add_layout"]
