"""MuJoCo: soft contacts with its constants as they come, or matched to the case's law."""

from __future__ import annotations

from crossbody.engines.mujoco._engine import Mujoco

ENGINE = Mujoco()
