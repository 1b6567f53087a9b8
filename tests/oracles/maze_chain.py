"""The maze as MuJoCo can follow its law: the ball twice, on a polar chain for faces and on slides for all else.

On the chain (hinge b, slide rho, spin psi) a ring's face is a limit of the slide and rolling a fixed tendon, linear in
the joints: both hold without error. The chain is singular on the axis and knows no tips, so that a ball that touches no
face is carried by two slides and a spin, where a tip is a pair of spheres. One of the two balls stands still.
"""

from __future__ import annotations

from typing import Any

import mujoco

from crossbody.cases import Law
from crossbody.engines._maze.scene import BallMaze
from crossbody.engines.mujoco._direct import MAX_IMPEDANCE, solref_of

FAR = 1e10
"""Margin that no gap falls below, m."""
TIPS = ("tip1", "tip2", "tip4", "tip5")
"""Spheres in the slots of the rows, put where the gaps of the moment are. In the model they must stand off the axis:
MuJoCo skips the position of a geom that was compiled onto its body's own frame."""
THETA, B, RHO, PSI, X, Y, PHI = range(7)
"""Coordinates of the model, which are its degrees of freedom as well."""

_XML = """
<mujoco>
  <compiler angle="radian" inertiafromgeom="false"/>
  <option gravity="0 {gravity!r} 0" integrator="RK4" jacobian="dense" solver="PGS" iterations="20" tolerance="0"/>
  <default>
    <joint type="hinge" axis="0 0 1"/>
    <geom type="sphere" contype="0" conaffinity="0"/>
    <pair condim="1" solref="{normal}" solimp="{solimp}" margin="{off}"/>
  </default>
  <worldbody>
    <body name="maze">
      <inertial pos="0 0 0" mass="1" diaginertia="{Jm!r} {Jm!r} {Jm!r}"/>
      <joint name="theta"/>
      {tips}
    </body>
    <body name="rolling" gravcomp="1" pos="1 0 0">
      <inertial pos="0 0 0" mass="{mb!r}" diaginertia="{Jb!r} {Jb!r} {Jb!r}"/>
      <joint name="b" pos="-1 0 0"/>
      <joint name="rho" type="slide" axis="1 0 0" ref="1" limited="true" range="0 1" margin="{off}"
             solreflimit="{normal}" solimplimit="{solimp}"/>
      <joint name="psi"/>
    </body>
    <body name="flying" gravcomp="1">
      <inertial pos="0 0 0" mass="{mb!r}" diaginertia="{Jb!r} {Jb!r} {Jb!r}"/>
      <joint name="x" type="slide" axis="1 0 0"/>
      <joint name="y" type="slide" axis="0 1 0"/>
      <joint name="phi"/>
      <geom name="ball" size="{r!r}"/>
    </body>
  </worldbody>
  <tendon>
    <fixed name="slip">
      <joint joint="theta" coef="1"/><joint joint="b" coef="1"/><joint joint="psi" coef="1"/>
    </fixed>
  </tendon>
  <equality>
    <tendon name="slip" tendon1="slip" solref="{slip}" solimp="{solimp}" active="false"/>
  </equality>
  <contact>{pairs}</contact>
</mujoco>
"""


def compiled(maze: BallMaze, law: Law) -> Any:
    """The model; every row of it is closed to begin with.

    Raises:
        ValueError: MuJoCo's own, for a model that it refuses.
    """
    p = maze.plant
    text = _XML.format(
        gravity=-p.g, Jm=p.Jm, mb=p.mb, Jb=p.Jb, r=p.r, off=-FAR,
        solimp=f"{MAX_IMPEDANCE} {MAX_IMPEDANCE} 0.001 0.5 1",
        normal=_pair(solref_of(law.a0[0], law.a1[0])),
        slip=_pair(solref_of(law.a0[6], law.a1[6])) if maze.rows.rolling else "0 0",
        tips="".join(f'<geom name="{tip}" size="1" pos="1 1 0"/>' for tip in TIPS),
        pairs="".join(f'<pair name="{tip}" geom1="{tip}" geom2="ball"/>' for tip in TIPS),
    )  # fmt: skip
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET | mujoco.mjtDisableBit.mjDSBL_ISLAND
    for weights in (model.body_invweight0, model.dof_invweight0, model.tendon_invweight0):
        weights[:] = REGULARISATION / p.mb
    return model


REGULARISATION = 1e-7
"""What R is made from, over the inverse mass of the ball. The model's own start, with the ball on the axis, tells
nothing: assigned, not scaled."""


def _pair(solref: tuple[float, float]) -> str:
    return f"{float(solref[0])!r} {float(solref[1])!r}"
