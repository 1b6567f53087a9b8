"""Feet of one body that turns cannot all stick: of sets of modes only one that all rows meet is a motion, if one is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mode_enumeration import Contact, enumerated

from crossbody import cases
from crossbody.cases import Mode, Outcome
from crossbody.reference import simulate
from crossbody.reference.sundials.equations import Equations
from crossbody.reference.sundials.sliding import Sliding
from crossbody.reference.tree.system import system

LADDER = """<mujoco><option cone="elliptic"/><worldbody>
  <geom name="floor" type="plane" size="5 5 .1" friction=".6 0 0"/>
  <geom name="wall" type="plane" size="5 5 .1" quat="0.70710678 0 0.70710678 0" friction=".3 0 0"/>
  <body name="rod" pos=".45 0 .65" euler="0 -30 0"><freejoint/>
    <geom name="rod" type="capsule" size=".05 .7" mass="1" friction=".3 0 0"/></body>
</worldbody></mujoco>"""
"""A rod slides down a wall, and up again while its foot sticks, as its top still returns to its law."""
TURNS, FOOT, TOP = 0.1442766, 0, 3  # s, at which the slip of its top passes zero; rows


@pytest.fixture(scope="module")
def ladder(tmp_path_factory: pytest.TempPathFactory) -> cases.Case:
    path: Path = tmp_path_factory.mktemp("ladder") / "ladder.xml"
    path.write_text(LADDER)
    return cases.from_file(str(path), friction=1)


def test_one_set_alone_is_met_where_the_top_of_a_ladder_turns_round(ladder: cases.Case) -> None:
    made = system(ladder.scene, ladder.law)
    found = simulate(made, ladder.q0, ladder.v0, TURNS, rtol=1e-11)
    rows = Sliding(made, Equations(made), 1e-11)
    seen = rows.see(float(found.t[-1]), found.q[-1].copy(), found.v[-1].copy(), [FOOT, TOP])
    contacts = [Contact(seen.at[i], [seen.at[k] for k in rows.ways[i]], float(rows.mu[i])) for i in (FOOT, TOP)]
    agree = {one.modes for one in enumerated(seen.G, seen.bare, contacts) if one.margin > 0.0}
    assert agree == {("stick", "slip")}


@pytest.mark.parametrize(
    ("solver", "rtol"), [("compiled", 1e-6), ("compiled", 1e-9), ("compiled", 1e-11), ("cvode", 1e-9), ("cvode", 1e-10)]
)
def test_the_top_of_a_ladder_turns_round_without_a_stop(ladder: cases.Case, solver: str, rtol: float) -> None:
    made = system(ladder.scene, ladder.law)
    found = simulate(made, ladder.q0, ladder.v0, 0.2, rtol=rtol, solver=solver)
    assert found.outcome is Outcome.FINISHED, found.message
    assert not [e for e in found.events if e.t > TURNS - 1e-3 and e.before != e.after]
    assert found.unique_until == np.inf
    assert (int(found.mode[-1, FOOT]), int(found.mode[-1, TOP])) == (Mode.STICK, Mode.SLIP)
