"""Pinocchio: the case's law by its constrained dynamics, impacts in no time, or an LCP in time steps."""

from __future__ import annotations

from crossbody.engines.pinocchio._engine import Pinocchio

ENGINE = Pinocchio()
