"""What `list` must say of a robot file whose parts are written out here."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from crossbody.reports import described
from crossbody.reports.judging.asked import Found, Within, unlike

FILE = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/><body name="cart" pos="0 0 1">
<joint name="rail" type="slide" axis="1 0 0" range="-3 5"/><inertial pos="0 0 0" mass="1.5" diaginertia="1 1 1"/>
<body name="arm"><joint name="swing" axis="0 1 0"/><geom name="tip" type="sphere" size=".1" mass=".25" pos="0 0 -.5"/>
</body></body></worldbody>
<actuator><general name="drive" joint="rail" ctrlrange="-1 2" ctrllimited="true" forcerange="-3 4" forcelimited="true"/>
</actuator><keyframe><key name="up" qpos=".5 1"/></keyframe></mujoco>"""
SAID = {
    "Variants": {"up": "2 bodies, 2 degrees of freedom"},
    "Rows": {"rail low": "", "rail high": ""},
    "Rows if its motion comes to a contact with friction": {"floor:tip": "", "floor:tip t1": "", "floor:tip t2": ""},
    "Coordinates (--start)": {"rail": "m", "swing": "rad"},
    "Velocities (--rate)": {"rail": "m/s", "swing": "rad/s"},
    "Bodies (--push)": {"cart": "1.5 kg", "arm": "0.25 kg"},
    "Actuators (columns of --ctrl)": {"drive": "[-1, 2]"},
}
"""Heading -> name -> what stands beside it."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return what, number, least and most, and of which heading, where the file is said to be another one."""
    return unlike((_listed,), "list", "a made-up robot file, which ends in")


def _listed() -> Iterator[Within]:
    """Yield how many names under a heading are others, or have other words beside them, than must be."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cart.xml"
        path.write_text(FILE, encoding="utf-8")
        found = described.one(str(path))
    for title, named in SAID.items():
        other = set(found.get(title, {}).items()) ^ set(named.items())
        yield f"names under {title}", "a made-up robot file", float(len(other)), 0.0, 0.0
