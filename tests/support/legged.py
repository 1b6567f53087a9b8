"""Robots on legs that fall on a tilted floor, drawn at random: rubbing joints, feet that stick, slide and come close
to jams.
"""

from __future__ import annotations

import numpy as np

HIPS = ((0.2, 0.15), (0.2, -0.15), (-0.2, 0.15), (-0.2, -0.15))
SHANK = 'type="capsule" size=".02" fromto="0 0 0 0 0 -.2"'
OFF = 'contype="0" conaffinity="0"'


def legged(seed: int) -> str:
    """Return MJCF of a body on four legs of two joints each, 1.5 cm above the floor."""
    rng = np.random.default_rng(seed)
    mu, loss = rng.uniform(0.3, 2.0), rng.choice([0.5, 2.0])
    tilt = rng.uniform(-16.0, 16.0, 2)
    joint = f'axis="0 1 0" frictionloss="{loss}" armature="0.01"'
    legs = "".join(
        f'<body pos="{x} {y} 0"><joint name="hip{i}" {joint}/><geom {SHANK} mass=".3" {OFF}/>'
        f'<body pos="0 0 -.2"><joint name="knee{i}" {joint}/><geom {SHANK} mass=".1"/></body></body>'
        for i, (x, y) in enumerate(HIPS)
    )
    turned = np.deg2rad(np.abs(tilt)).sum()
    height = 0.4 * np.cos(0.5) + 0.035 + 0.25 * np.tan(turned)
    speed = " ".join(f"{x:.5f}" for x in rng.normal(0.0, 0.3, 3))
    return (
        '<mujoco><option cone="elliptic"/><worldbody>'
        f'<geom type="plane" size="5 5 .1" friction="{mu:.4f} 0 0" euler="{tilt[0]:.3f} {tilt[1]:.3f} 0"/>'
        f'<body><freejoint/><geom type="box" size=".25 .15 .05" mass="{rng.uniform(2.0, 6.0):.3f}" {OFF}/>{legs}</body>'
        f'</worldbody><keyframe><key qpos="0 0 {height:.5f} 1 0 0 0{" 0.5 -1" * 4}" qvel="{speed}{" 0" * 11}"/>'
        "</keyframe></mujoco>"
    )
