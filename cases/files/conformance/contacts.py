"""Features of MJCF: which shapes may touch, how rough they are, how soft contacts, bounds and loops."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.cases.files.conformance.arm import (
    ELBOW,
    ELBOW_TEXT,
    LOWER,
    LOWER_INERTIAL,
    SHOULDER,
    UPPER,
    UPPER_INERTIAL,
    Feature,
    arm,
    mjcf,
)
from crossbody.cases.scene import Body, Joint, Loop, Pair, RowLaw, Scene, Shape

FILTER = "Two shapes may touch if contype of one and conaffinity of the other have a common bit."
MIXED = (
    "The shape of higher priority determines friction and condim; otherwise the larger values apply. Margins are added."
)
SOFT = "solref is a time constant and a damping ratio, or, if negative, a stiffness and a damping."
MIXED_SOFT = (
    "The softness of two shapes is a mean weighted by solmix, or the smaller numbers if either gives a stiffness."
)
SAFE = "A time constant is at least two time steps unless the flag refsafe is off."
DIRECT = "Set it in the engine: solref, solimp and solmix are specific to MuJoCo."
STIFF_BY = 0.95  # the largest impedance that solimp has where it is not given
SHAPES = {
    "floor": Shape(name="floor", type="plane", size=(1.0, 1.0, 0.1)),
    "a": Shape(name="a", body="upper", size=(0.1, 0.0, 0.0), position=(0.0, 0.0, -0.1)),
    "b": Shape(name="b", body="lower", size=(0.05, 0.0, 0.0), position=(0.0, 0.0, -0.2)),
    "c": Shape(name="c", body="hand", size=(0.04, 0.0, 0.0)),
}


def softness(time: float = 0.02, ratio: float = 1.0, largest: float = STIFF_BY) -> RowLaw:
    """Return the law of a time constant and damping ratio."""
    return RowLaw(a0=1.0 / (largest * time**2 * ratio**2), a1=2.0 / (largest * time))


def meeting(*names: str, friction: tuple[float, ...] = (1.0, 1.0, 0.0, 0.0, 0.0), **more: Any) -> tuple[Pair, ...]:
    """Return pairs of shapes, two names with a colon between them; as of shapes of which nothing is said."""
    common: dict[str, Any] = {"friction": friction, "dimension": 3, "law": softness()} | more
    return tuple(
        Pair(name=name, first=first, second=second, **common) for name in names for first, second in [name.split(":")]
    )


def touching(floor: str = "", a: str = "", b: str = "", head: str = "", tail: str = "", wrist: bool = False) -> str:
    """Return the arm with a ball on each link above a plane, and a third link if wanted."""
    hand = (
        '<body name="hand" pos="0 0 -.3"><joint name="wrist" axis="0 1 0"/>'
        f'{LOWER_INERTIAL}<geom name="c" size=".04"/></body>'
    )
    return mjcf(
        before=f'<geom name="floor" type="plane" size="1 1 .1" {floor}/>',
        upper_inertial=f'{UPPER_INERTIAL}<geom name="a" size=".1" pos="0 0 -.1" {a}/>',
        lower_inertial=f'{LOWER_INERTIAL}<geom name="b" size=".05" pos="0 0 -.2" {b}/>{hand * wrist}',
        head=head,
        tail=tail,
    )


def above(names: str = "floor a b", pairs: tuple[Pair, ...] = (), wrist: bool = False) -> Scene:
    """Return the scene of that, with some of its shapes."""
    more: dict[str, Any] = {"shapes": tuple(SHAPES[name] for name in names.split()), "pairs": pairs}
    if not wrist:
        return arm(**more)
    hand = Body(name="hand", parent="lower", position=(0.0, 0.0, -0.3), mass=1.0, com=LOWER.com, inertia=LOWER.inertia)
    joint = Joint(name="wrist", body="hand", type="hinge", axis=(0.0, 1.0, 0.0))
    return arm(bodies=(UPPER, LOWER, hand), joints=(SHOULDER, ELBOW, joint), **more)


def features() -> list[Feature]:
    """Return the features of contacts and of how soft rows are."""
    both, hung = ("floor:a", "floor:b"), ("floor:a", "floor:b", "floor:c")
    pair = '<contact><pair geom1="a" geom2="b" {}/></contact>'
    apart = 'contype="0" conaffinity="0"'

    def filtered(name: str, finds: str, text: str, scene: Scene, rule: str = FILTER, rewrite: str = "") -> Feature:
        return Feature(name, text, scene, finds, rule, rewrite, ("shapes", "contacts"))

    def rough(name: str, finds: str, text: str, pairs: tuple[Pair, ...], rule: str = MIXED) -> Feature:
        return Feature(name, text, above(pairs=pairs), finds, rule, "Set friction in the engine.", ("surfaces",))

    def soft(name: str, finds: str, law: RowLaw, rule: str = SOFT, head: str = "", **at: Any) -> Feature:
        pairs = (*meeting("floor:a", law=law), *meeting("floor:b"))
        text = touching(head=head, **at)
        return Feature(name, text, above(pairs=pairs), finds, rule, DIRECT, ("softness",))

    def bound(name: str, attributes: str, finds: str, law: RowLaw, rule: str = SOFT, head: str = "") -> Feature:
        joint = f'<joint name="elbow" axis="1 0 0" range="-30 60" limited="true" {attributes}/>'
        range_ = (-np.pi / 6, np.pi / 3)
        return Feature(name, mjcf(head=head, elbow=joint), arm(elbow={"range": range_, "law": law}), finds, rule,
                       DIRECT, ("softness",))  # fmt: skip

    step, unsafe = '<option timestep=".005"/>', '<option timestep=".005"><flag refsafe="disable"/></option>'
    switched = "Rows that a flag disables do not exist."
    return [
        filtered("shapes that may touch", ".//body/geom", touching(), above(pairs=meeting(*both)),
            "Shapes of a body and of its parent do not touch, unless the parent is the world."),
        filtered("bodies that are excluded", "contact/exclude",
            touching(wrist=True, tail='<contact><exclude body1="upper" body2="hand"/></contact>'),
            above("floor a b c", meeting(*hung), wrist=True), "Shapes of two bodies that are excluded do not touch.",
            "Exclude them in the engine."),
        filtered("bodies that are not excluded", ".//body/geom", touching(wrist=True),
            above("floor a b c", meeting(*hung, "a:c"), wrist=True)),
        filtered("parent and child that touch", "option/flag[@filterparent]",
            touching(head='<option><flag filterparent="disable"/></option>'),
            above(pairs=meeting(*both, "a:b")), "With the flag filterparent off, a body touches its parent.",
            "Let them touch in the engine."),
        filtered("shapes of other bits", ".//geom[@contype] | .//geom[@conaffinity]",
            touching(b='contype="2" conaffinity="2"'), above(pairs=meeting("floor:a")),
            rewrite="Set the pairs that may touch in the engine."),
        filtered("shape that touches nothing", ".//geom[@contype='0'][@conaffinity='0']", touching(b=apart),
            above("floor a", meeting("floor:a"))),
        filtered("bits of a class", ".//default/geom[@contype] | .//default/geom[@conaffinity]",
            touching(head='<default><geom contype="2"/></default>', floor='contype="1"'),
            above(pairs=meeting(*both)), rewrite="Write them at the geom itself."),
        filtered("pair of the file", "contact/pair", touching(a=apart, b=apart, tail=pair.format("")),
            above(pairs=meeting("a:b")), "A <pair> touches whatever the filters say.", "Let it touch in the engine."),
        Feature("class with a nested class",
            touching(a='class="bare"', b='class="bare"', head='<default><default class="drawn"><geom material="none"/>'
            '</default><default class="bare"><geom group="3"/></default></default>').replace('"upper" pos',
            '"upper" childclass="drawn" pos'), above(pairs=meeting(*both)), ".//default/geom[@material]",
            "A geom that names a class ignores the childclass of its body.",
            "Write the values of the class at the geom itself, as --fix does.", ("shapes",)),
        filtered("contacts switched off", "option/flag[@contact]",
            touching(head='<option><flag contact="disable"/></option>'), above(), switched),
        rough("friction of two shapes", ".//geom[@friction]", touching('friction=".5"', 'friction=".8"'),
            (*meeting("floor:a", friction=(0.8, 0.8, 0.0, 0.0, 0.0)), *meeting("floor:b"))),
        rough("friction by priority", ".//geom[@priority]", touching('friction=".5" priority="1"', 'friction=".8"'),
            meeting(*both, friction=(0.5, 0.5, 0.0, 0.0, 0.0))),
        rough("friction of a class", ".//default/geom[@friction]",
            touching(head='<default><geom friction=".3"/></default>'),
            meeting(*both, friction=(0.3, 0.3, 0.0, 0.0, 0.0))),
        rough("contact without friction", ".//geom[@condim='1']", touching('condim="1"', 'condim="1"'),
            (*meeting("floor:a", dimension=1), *meeting("floor:b")), "With condim 1 a contact has no friction."),
        rough("torsional friction", ".//geom[@condim='4']", touching(a='condim="4" friction="1 .02 .01"'),
            (*meeting("floor:a", dimension=4, friction=(1.0, 1.0, 0.02, 0.0, 0.0)), *meeting("floor:b")),
            "With condim 4 a contact has friction about its normal too."),
        rough("rolling friction", ".//geom[@condim='6']", touching(a='condim="6" friction="1 .02 .01"'),
            (*meeting("floor:a", dimension=6, friction=(1.0, 1.0, 0.02, 0.01, 0.01)), *meeting("floor:b")),
            "With condim 6 a contact has friction against rolling too."),
        rough("margins of two shapes", ".//geom[@margin]", touching('margin=".01"', 'margin=".02"'),
            (*meeting("floor:a", margin=0.03), *meeting("floor:b", margin=0.01))),
        Feature("details of a pair", touching(a=apart, b=apart, tail=pair.format('condim="6" friction=".4 .5 .02 .01 '
            '.03" margin=".04" solref=".05 .8" solimp=".8 .9 .01"')), above(pairs=meeting("a:b", dimension=6,
            friction=(0.4, 0.5, 0.02, 0.01, 0.03), margin=0.04, law=softness(0.05, 0.8, 0.9))),
            "contact/pair[@friction] | contact/pair[@margin] | contact/pair[@condim] | contact/pair[@solref]",
            "The values of a <pair> override those of its shapes.", DIRECT, ("surfaces", "softness")),
        soft("softness of two shapes", ".//geom[@solref]", softness(0.035, 0.9), MIXED_SOFT, a='solref=".05 .8"'),
        soft("softness by solmix", ".//geom[@solmix]", softness(0.03, 0.9, 0.9), MIXED_SOFT,
            floor='solref=".02 1"', a='solref=".06 .6" solmix=".3333333333333333" solimp=".8 .75 .01"'),
        soft("softness by priority", ".//geom[@priority]", softness(0.06, 0.6), MIXED_SOFT,
            a='solref=".06 .6" priority="1"'),
        soft("stiffness of one shape and time constant of another", ".//geom[@solref]",
            RowLaw(a0=1000.0 / STIFF_BY, a1=30.0 / STIFF_BY), MIXED_SOFT, a='solref="-1000 -30"'),
        soft("stiffness of two shapes", ".//geom[@solref]", RowLaw(a0=1000.0 / STIFF_BY, a1=50.0 / STIFF_BY),
            MIXED_SOFT, a='solref="-1000 -30" priority="0"', head='<default><geom solref="-400 -50"/></default>',
            b='solref=".02 1" priority="1"'),
        bound("softness of a bound", 'solreflimit=".05 .8" solimplimit=".8 .9 .01"', ".//joint[@solreflimit]",
            softness(0.05, 0.8, 0.9)),
        bound("stiffness of a bound", 'solreflimit="-1000 -30"', ".//joint[@solreflimit]",
            RowLaw(a0=1000.0 / STIFF_BY, a1=30.0 / STIFF_BY)),
        bound("time constant below two steps", 'solreflimit=".002 1"', ".//joint[@solreflimit]", softness(0.01), SAFE,
            step),
        bound("time constant with refsafe off", 'solreflimit=".002 1"', "option/flag[@refsafe]", softness(0.002),
            SAFE, unsafe),
        Feature("bounds switched off",
            mjcf(head='<option><flag limit="disable"/></option>', elbow=ELBOW_TEXT.replace("/>", ' range="-30 60"/>')),
            arm(), "option/flag[@limit]", switched, "Leave the bounds out.", ("limits",)),
        Feature("softness of an equality",
            mjcf(tail='<equality><joint name="c" joint1="elbow" solref=".05 .8"/></equality>'),
            arm(loops=(Loop(name="c", type="joint", first="elbow", law=softness(0.05, 0.8)),)),
            "equality/*[@solref]", SOFT, DIRECT, ("softness",)),
        Feature("equalities switched off", mjcf(head='<option><flag equality="disable"/></option>',
            tail='<equality><connect name="c" body1="lower" anchor="0 0 -.3"/></equality>'), arm(),
            "option/flag[@equality]", switched,
            "Leave the equalities out.", ("loops",)),
    ]  # fmt: skip
