"""What is left out of a robot's file: every engine moves as by a file in which it was never written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case

PARTS = {
    "friction": ' frictionloss=".3"',
    "limits": ' limited="true" range="-.1 .1"',
    "actuators": '<actuator><motor name="push" joint="swing" gear="2"/>'
                 '<position name="hold" joint="slide" kp="30" kv="1"/></actuator>',
    "loops": '<equality><joint name="gear" joint1="swing" joint2="slide" polycoef="0 1 0 0 0"/></equality>',
    "tendons": '<tendon><fixed name="rope" stiffness="40" damping="2" limited="true" range="-.2 .1">'
               '<joint joint="swing" coef=".5"/><joint joint="slide" coef="1"/></fixed></tendon>',
    "contacts": '<geom name="floor" type="plane" size="5 5 .1" condim="1" pos="0 0 -.45"/>',
}  # fmt: skip
"""What each word of `without` leaves out, as it is written."""
FILE = """
<mujoco><compiler angle="radian"/><worldbody>{contacts}
<body><joint name="swing" axis="0 1 0"{friction}{limits}/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1.2" condim="1"/></body>
<body pos="1 0 0"><joint name="slide" type="slide" axis="0 0 1"{limits}/><geom size=".06" mass=".7" condim="1"/></body>
</worldbody>{stop}{tendons}{actuators}{loops}
<keyframe><key name="start" {start}{ctrl}/></keyframe></mujoco>
"""
STOP = '<tendon><fixed name="stop" limited="true" range="-.2 .1"><joint joint="swing" coef="1"/></fixed></tendon>'
BEYOND_LIMITS, IN_THE_FLOOR = 'qpos=".15 .15" qvel=".5 .5"', 'qpos=".05 -.392" qvel=".5 -.5"'
CTRL = ' ctrl="3 .4"'
ONE = {"actuator:push,actuator:hold": "actuators", "loop:gear": "loops", "tendon:rope": "tendons"}
WORDS = {word: word for word in PARTS} | ONE


def loaded(folder: Path, parts: set[str], start: str, without: str = "") -> Case:
    path = folder / f"{len(list(folder.iterdir()))}.xml"
    text = {name: part if name in parts else "" for name, part in PARTS.items()}
    text["stop"] = STOP if "limits" in parts else ""
    path.write_text(FILE.format(start=start, ctrl=CTRL if "actuators" in parts else "", **text), encoding="utf-8")
    return cases.load(str(path), "start", t_end=0.05, without=without)


def end(case: Case, engine: str) -> np.ndarray:
    run = engines.load(engine).prepare(case, "compiled" if engine == "reference" else "as_is").run()
    assert run.outcome.ok, run.message
    return np.concatenate([run.q[-1], run.v[-1]])


@pytest.mark.parametrize("engine", ["reference", "mujoco"])
@pytest.mark.parametrize("words", WORDS)
def test_what_is_left_out_is_as_if_it_was_never_written(words: str, engine: str, tmp_path: Path) -> None:
    part = WORDS[words]
    start = IN_THE_FLOOR if part == "contacts" else BEYOND_LIMITS
    other = {"loops", "tendons"} - {part} if part not in ("contacts", "limits") else set()
    never = end(loaded(tmp_path, other, start), engine)
    assert end(loaded(tmp_path, {part, *other}, start, words), engine) == pytest.approx(never, abs=1e-9)
    if part != "friction":  # which is refused
        assert np.abs(end(loaded(tmp_path, {part, *other}, start), engine) - never).max() > 1e-4


BALL = """
<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1" {floor}/>
<body pos="0 0 .1"><freejoint/><geom name="ball" size=".1" {ball}/></body></worldbody>{pair}
<keyframe><key name="rolls" qpos="0 0 .099 1 0 0 0" qvel="1 0 0 0 10 3"/></keyframe></mujoco>
"""
SLIDES, ROLLS = 'condim="3" friction=".7"', 'condim="{}" friction=".7 .05 .02"'
PAIR = '<contact><pair geom1="floor" geom2="ball" {}/></contact>'


@pytest.mark.parametrize("engine", ["reference", "mujoco"])
@pytest.mark.parametrize("dimension", [4, 6])
@pytest.mark.parametrize("listed", [False, True])
def test_without_rolling_friction_contacts_slide_alone(
    engine: str, dimension: int, listed: bool, tmp_path: Path
) -> None:
    def ends(friction: str, without: str = "") -> np.ndarray:
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.xml"
        bare = "" if listed else friction
        pair = PAIR.format(friction.replace('".7 ', '".7 .7 ').replace('.02"', '.02 .02"')) if listed else ""
        path.write_text(BALL.format(floor=bare, ball=bare, pair=pair), encoding="utf-8")
        return end(cases.load(str(path), "rolls", t_end=0.5, without=without, friction=1), engine)

    rolls = ROLLS.format(dimension)
    assert ends(rolls, "rolling") == pytest.approx(
        ends(SLIDES.replace('".7', '".7 .7' if listed else '".7')), abs=1e-12
    )
    if engine == "mujoco":
        assert np.abs(ends(rolls, "rolling") - ends(rolls)).max() > 1e-3
