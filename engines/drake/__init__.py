"""Drake: the case's equations or a MultibodyPlant under error-controlled integrators, or its discrete plant."""

from __future__ import annotations

from crossbody.engines.drake._engine import Drake

ENGINE = Drake()
