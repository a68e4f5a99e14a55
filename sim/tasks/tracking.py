"""Tracking: the world of detection; its objects move."""

from __future__ import annotations

from sim.worlds.detection import add_layout

__all__ = ["add_layout"]
