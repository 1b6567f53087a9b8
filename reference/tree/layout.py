"""Where each number of a scene stands in the parameters and in the scratch of the kernels."""

from __future__ import annotations

FREE, BALL, SLIDE, HINGE = range(4)

# Head of the table: sizes, gravity, where each part begins, the potential energy of what never moves, how many rows
# need the poses of bodies, and along how many tendons between two points something acts.
NODES, DOFS, ACTUATORS, TENDONS, ROWS, GRAVITY, AT_DOF, AT_ACTUATOR, AT_TENDON, AT_ROW, AT_NODE, AT_PAIR = (
    0, 1, 2, 3, 4, 5, 8, 9, 10, 11, 12, 13,
)  # fmt: skip
# Then how many pairs of shapes lie to each other in more than one way; how many kinks forces have, where these, the
# sides on which they are, and their bands stand, and the tolerance that is in force: the inputs follow it.
RESTING, POSED, PUSHES, AT_PUSH, AT_SIDE, SPANNED, LYING, KINKS, AT_KINK, AT_BEND, AT_BAND, AT_TOLD = range(14, 26)
# How many of the kinks are those of sums of forces, of gaps, and of actuators on one hinge or slide each; where the
# code of the sweeps stands that was traced for the model, 0 for none; how many actuators can exert a force, and of how
# many velocities the sum of such forces is bounded.
SUMMED, GAPPED, PLAIN, TRACED, EXERTING, BOUNDED, HEAD = 26, 27, 28, 29, 30, 31, 32

# A node: what it is, its pose in its parent, its inertia, and what its joint does by itself.
TYPE, PARENT, Q, V, ROOT, REFERENCE, POSE, AXIS, ANCHOR, MASS, COM, INERTIA, LIFT, STIFFNESS, REST, NODE = (
    0, 1, 2, 3, 4, 5, 6, 42, 45, 48, 49, 52, 58, 62, 65, 69,
)  # fmt: skip
# Behind two bounds, and behind the constants of a damper, stands the number of the kink there; -1 where there is none.
BOUNDS_BEND, DAMPER_BEND = 2, 3
# A degree of freedom: the one before it on the way to the world, armature, damping, bounds of its actuators' sum.
BEFORE, ARMATURE, DAMPING, SUM, DOF = 0, 1, 2, 6, 9
# An actuator: what kind of thing it moves and which, gear of up to six velocities, constants and bounds; of its
# activation what it is, its time constant and bounds, and where in u the instant and the value stand that it goes from;
# whether it acts on a hinge or a slide without one.
TARGET, WHICH, ANGLE, GEAR, GAIN, BIAS, CONTROL, FORCE, ACTIVATION, TAU, SPAN, SINCE, SINGLE, ACTUATOR = (
    0, 1, 2, 3, 9, 12, 15, 17, 20, 21, 22, 25, 26, 27,
)  # fmt: skip
ON_JOINT, ON_TENDON = 0, 1
DIRECT, INTEGRATOR, FILTER = range(3)
# A push: the node that it acts on, and where in its frame.
PUSHED, PUSH = 0, 4
# A kink: what bends there, of which actuator, degree of freedom, tendon or pair; of a pair which of its kinks, and the
# row that it matters to while that is in contact.
BEND, OF, BENDS, BENT_ROW, KINK = 0, 1, 2, 3, 4
FORCE_BENDS, SUM_BENDS, ACTIVATION_BENDS, SPRING_BENDS, DRAG_BENDS, TENDON_DRAG_BENDS, GAP_BENDS = range(7)
# On which side of a kink a value is: not held, so that the value itself tells; between both bounds; below; above.
OPEN, INSIDE, LOW, HIGH = range(4)
# A tendon: its spring, damper and dead band; then joint by joint the coordinate, the velocity and the coefficient. One
# between two points has -3 joints, and in their room a node and a point in its frame, twice.
COUNT, STIFF, DAMP, BAND, FIRST, POINTS = 0, 1, 4, 8, 11, -3
# A constraint row: kind, sign or component, places of coordinates, and numbers of its own.
KIND, ROW = 0, 24
LIMIT, TENDON_LIMIT, JOINT_LOOP, CONNECT, CONTACT, TURN, TENDON_LOOP, STRING, BALL_LIMIT, TANGENT = range(10)
DRY_JOINT, DRY_TENDON, DRY_STRING = range(10, 13)  # friction of a velocity, of a sum of joints, of a distance
LED, LEADS, POLYNOMIAL = 1, 4, 7  # of a coupling: coordinate and velocity, or tendon; where it rests; coefficients
OF_POSES = (CONNECT, CONTACT, TURN, STRING, TANGENT, DRY_STRING)

# What is kept of a node while it is computed: pose (rotation by rows, position from its tree's root), velocity,
# acceleration without v', force, inertia, and of a root its origin in the world; of a degree of freedom: its motion
# subspace (angular, linear).
POSE_AT, V_AT, A_AT, F_AT, I_AT, ORIGIN_AT, NODE_SCRATCH = 0, 12, 18, 24, 30, 40, 43
DOF_SCRATCH = 6
