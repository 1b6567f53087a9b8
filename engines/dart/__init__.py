"""DART: rigid contacts with a restitution, a linear complementarity problem in every time step."""

from __future__ import annotations

from crossbody.engines.dart._engine import ENGINE

__all__ = ["ENGINE"]
