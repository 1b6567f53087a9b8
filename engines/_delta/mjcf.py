"""The delta robot as one MJCF text that both MuJoCo and Pinocchio's importer read (spec 3.8).

Pinocchio reads only the first body of the world: all arms hang on one fixed base with a dummy inertia. Two hinges share
the distal body. The loops are two `connect` constraints between sites at the tips, arms 2 and 3 against arm 1.
z points down, so gravity is +g. Friction acts on absolute angles and is not a joint damping of this tree: the engines
add it as a force.
"""

from __future__ import annotations

from crossbody.reference.delta import Robot

THIN = 2e-15
"""Inertia of a rod about itself, kg m^2: MuJoCo refuses less than 1e-15."""
JOINTS = tuple(f"{name}{i}" for i in (1, 2, 3) for name in ("q", "alpha", "gamma"))
"""Names of the nine hinges in the order of the chart."""

_ARM = """
      <body name="proximal{i}" pos="{x!r} {y!r} 0" quat="{cos!r} 0 0 {sin!r}">
        <inertial pos="0 {half1!r} 0" mass="{m1!r}" diaginertia="{rod1!r} {thin!r} {rod1!r}"/>
        <joint name="q{i}" type="hinge" axis="1 0 0" armature="{jm!r}"/>
        <body name="distal{i}" pos="0 {l1!r} 0">
          <inertial pos="0 {half2!r} 0" mass="{m2!r}" diaginertia="{rod2!r} {thin!r} {rod2!r}"/>
          <joint name="alpha{i}" type="hinge" axis="1 0 0"/>
          <joint name="gamma{i}" type="hinge" axis="0 0 1"/>
          <body name="tip{i}" pos="0 {l2!r} 0">
            <inertial pos="0 0 0" mass="{m3!r}" diaginertia="0 0 0"/>
            <site name="end{i}"/>
          </body>
        </body>
      </body>"""

_MODEL = """<mujoco model="delta">
  <compiler angle="radian"/>
  <option gravity="0 0 {g!r}"{option}/>
  <worldbody>
    <body name="base">
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{arms}
    </body>
  </worldbody>
  <equality>
    <connect name="close2" site1="end1" site2="end2"{solve}/>
    <connect name="close3" site1="end1" site2="end3"{solve}/>
  </equality>
</mujoco>
"""


def _arm(robot: Robot, i: int) -> str:
    cos, sin = ((1.0, 0.0), (0.5, -robot.sign * 0.75**0.5), (0.5, robot.sign * 0.75**0.5))[i]
    along = (0.0, 1.0), (robot.sign * 0.75**0.5, -0.5), (-robot.sign * 0.75**0.5, -0.5)
    return _ARM.format(
        i=i + 1,
        x=robot.offset * along[i][0],
        y=robot.offset * along[i][1],
        cos=cos,
        sin=sin,
        l1=robot.l1,
        l2=robot.l2,
        half1=robot.l1 / 2,
        half2=robot.l2 / 2,
        m1=robot.m1,
        m2=robot.m2,
        m3=robot.m3 / 3,
        jm=robot.jm,
        rod1=robot.m1 * robot.l1**2 / 12,
        rod2=robot.m2 * robot.l2**2 / 12,
        thin=THIN,
    )


def mjcf(robot: Robot, option: str = "", solve: str = "") -> str:
    """The model as text.

    Args:
        robot: geometry, masses, gravity.
        option: further attributes of <option>.
        solve: attributes of both <connect>, such as solref.
    """
    arms = "".join(_arm(robot, i) for i in range(3))
    spaced = [f" {text}" if text else "" for text in (option, solve)]
    return _MODEL.format(g=robot.g, option=spaced[0], arms=arms, solve=spaced[1])
