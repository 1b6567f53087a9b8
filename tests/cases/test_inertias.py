"""Inertias in closed form beside MuJoCo's compiler, for files that are drawn."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from crossbody.cases.files.inertias import SOLIDS, of_shapes
from crossbody.cases.rotations import matrices


@pytest.mark.parametrize("seed", range(12))
def test_a_body_has_the_inertia_of_its_shapes_of_the_groups_that_count(seed: int, tmp_path: Path) -> None:
    """Unless it is given one: then that counts, or not, as the file says."""
    rng = np.random.default_rng(seed)
    low, high = sorted(rng.integers(0, 6, 2).tolist())
    always = ("auto", "true")[seed % 2]
    bodies, counting = "", set[str]()
    for name in "abcde":
        own = '<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>' if rng.random() < 0.3 else ""
        groups = rng.integers(0, 6, rng.integers(1, 4)).tolist()
        geoms = "".join(
            f'<geom type="{rng.choice(list(SOLIDS.values()))}" size=".1 .2 .3" group="{group}" density="700" '
            f'pos="{" ".join(map(str, rng.uniform(-1.0, 1.0, 3)))}" euler="{" ".join(map(str, rng.normal(size=3)))}"/>'
            for group in groups
        )
        bodies += f'<body name="{name}">{own}{geoms}</body>'
        if any(low <= group <= high for group in groups) and (always == "true" or not own):
            counting.add(name)
    path = tmp_path / "parts.xml"
    compiler = f'<compiler inertiafromgeom="{always}" inertiagrouprange="{low} {high}"/>'
    path.write_text(f"<mujoco>{compiler}<worldbody>{bodies}</worldbody></mujoco>")
    model, found = mujoco.MjModel.from_xml_path(str(path)), of_shapes(path)
    assert found.keys() == counting
    for name, one in found.items():
        body = model.body(name)
        R = matrices(body.iquat)
        assert one is not None
        assert one.mass == pytest.approx(body.mass[0], rel=1e-12)
        assert one.com == pytest.approx(body.ipos, abs=1e-12)
        assert one.about == pytest.approx(R @ np.diag(body.inertia) @ R.T, abs=1e-9 * body.inertia.max())
