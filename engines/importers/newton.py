"""Newton's readers of robot files: `newton.ModelBuilder.add_mjcf` and `add_urdf`, in single precision."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

FORMATS, PACKAGE, MODULE = ("mjcf", "urdf"), "newton", "newton"
TRIED, INSTALL = ("1.8", "1.8"), "newton[importers]"
KINDS = {0: "slide", 1: "hinge", 2: "ball", 4: "free"}
FIXED = 3
SHAPES = ("", "plane", "field", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "cone", "mesh")
COLLIDES = 2
UNSAID = 1e6  # force of a joint of whose bounds nothing is said, N m or N


class _Robot:
    free, ball = "p, xyzw; world, world", "xyzw; parent"
    hidden = {  # noqa: RUF012
        "damping v|v|": "Newton's dampers are linear.", "damping v^3": "Newton's dampers are linear.",
        "stiffness x^2": "Newton's springs are linear.", "stiffness x^3": "Newton's springs are linear.",
        "keyframes": "Newton has no keyframes.",
    }  # fmt: skip
    unseen = {  # noqa: RUF012
        "energy": "Newton does not report energy.", "tendons": "Newton keeps tendons only for its MuJoCo solver.",
        "surfaces": "Newton's solvers mix the friction of two shapes, each in its own way.",
        "softness": "Newton keeps solref only for its MuJoCo solver.",
    }  # fmt: skip
    precision = 2e-4

    def __init__(self, path: str, urdf: bool) -> None:
        import newton
        import warp as wp

        wp.config.quiet = True
        self._wp, self._newton, self.version = wp, newton, newton.__version__
        builder = newton.ModelBuilder()
        (builder.add_urdf if urdf else builder.add_mjcf)(path)
        self._m = m = builder.finalize(device="cpu")
        self._s = m.state()
        self.nq, self.nv = m.joint_coord_count, m.joint_dof_count
        named = _named(path)
        last, self._bodies = (
            [named.get(label.rpartition("/")[2], label.rpartition("/")[2]) for label in labels]
            for labels in (m.joint_label, m.body_label)
        )
        newton.eval_fk(m, m.joint_q, m.joint_qd, self._s)
        loops = (m.joint_articulation.numpy() < 0).tolist()
        kinds, self._child, at, first = (
            getattr(m, f"joint_{key}").numpy() for key in ("type", "child", "q_start", "qd_start")
        )
        ups = zip(self._child.tolist(), m.joint_parent.numpy().tolist(), kinds.tolist(), last, loops, strict=True)
        self._up = {child: (parent, kind, name) for child, parent, kind, name, closes in ups if not closes}
        dofs = np.diff([*first[: m.joint_count], self.nv])
        self._frees = []
        self.joints = []
        for i, name in enumerate(last):
            kind = KINDS.get(int(kinds[i]), f"of {dofs[i]} degrees of freedom")
            if loops[i]:
                continue
            if kinds[i] == 6 and dofs[i] > 0:
                axes = m.joint_dof_dim.numpy()[i]
                parts = ["slide"] * int(axes[0]) + ["hinge"] * int(axes[1])
                self.joints += [
                    (
                        f"{name} {k}" if len(parts) > 1 else name,
                        self._bodies[self._child[i]],
                        part,
                        int(at[i]) + k,
                        int(first[i]) + k,
                    )
                    for k, part in enumerate(parts)
                ]
            elif kinds[i] != FIXED:
                self.joints.append((name, self._bodies[self._child[i]], kind, int(at[i]), int(first[i])))
            if kind == "free":
                on = self._frame(int(m.joint_parent.numpy()[i]))
                stands = _behind(on, m.joint_X_p.numpy()[i]) if urdf else (np.zeros(3), np.eye(3))
                self._frees.append((int(at[i]), int(first[i]), int(self._child[i]), *stands))
        self.actuators: dict[str, list[str]] = {}
        self._motors(named)
        closing = [i for i, one in enumerate(loops) if one]
        self._closing = [i for i in closing if kinds[i] in (2, FIXED)]
        self.loops: Any = [("connect" if kinds[i] == 2 else "weld", [], []) for i in self._closing]
        self.loops += [("", [], [])] * (len(closing) - len(self._closing))
        factors = np.zeros((len(m.constraint_mimic_label), 5))
        if len(factors):
            pair = m.constraint_mimic_joint0.numpy(), m.constraint_mimic_joint1.numpy()
            factors[:, :2] = np.column_stack([m.constraint_mimic_coef0.numpy(), m.constraint_mimic_coef1.numpy()])
            rows = zip(*pair, factors, strict=True)
            self.loops += [("joint", [last[i], last[j]], row.tolist()) for i, j, row in rows]
        followed = m.joint_mimic_joint.numpy().tolist()  # how it keeps those of a URDF
        for i, j in ((i, j) for i, j in enumerate(followed) if j >= 0):
            self.loops.append(("joint", [last[i], last[j]], [*m.joint_mimic_coeffs.numpy()[i].tolist(), 0.0, 0.0, 0.0]))
        self.numbers = self._numbers()

    def _motors(self, named: dict[str, str]) -> None:
        """Find the actuators that it keeps for its MuJoCo solver, if all of them act on joints."""
        own = getattr(self._m, "mujoco", None)
        self._driven: list[tuple[str, int, Any, Any]] = []
        if not (labels := list(getattr(own, "actuator_label", []))):
            return
        kept = [getattr(own, f"actuator_{key}").numpy() for key in ("trntype", "trnid", "gear", "gainprm", "biasprm")]
        moved = {joint[4]: joint for joint in self.joints}
        if kept[0].any() or any(dof not in moved for dof in kept[1][:, 0]):
            self.unseen = self.unseen | {"actuators": "Newton keeps actuators of tendons only for its MuJoCo solver."}
            return
        for label, dof, gear, gain, bias in zip(labels, *(part for part in kept[1:]), strict=True):
            name = label.rpartition("/")[2]
            name = named.get(name, name)
            self.actuators[name] = [moved[dof[0]][0]]
            self._driven.append((name, int(dof[0]), gear, (gain, bias)))

    def drives(self) -> Any:
        driven, held = {}, np.zeros(self.nv)
        for name, dof, gear, (gain, bias) in self._driven:
            kind, at = next((joint[2], joint[3]) for joint in self.joints if joint[4] == dof)
            width = {"free": 6, "ball": 3}.get(kind, 1)
            moment, scalar = np.zeros(self.nv), width == 1
            moment[dof : dof + width] = gear[:width]
            motion = [1.0, gear[0] * self._q[at] if scalar else 0.0, float(moment @ self._v)]
            driven[name] = moment * float(gain[:3] @ motion)
            held += moment * float(bias[:3] @ motion)
        return driven, held

    def _frame(self, i: int) -> Any:
        return self.frames()[self._bodies[i]] if i >= 0 else (np.zeros(3), np.eye(3))

    def ends(self) -> Any:
        m, told = self._m, []
        for i in self._closing:
            sides = ((m.joint_parent, m.joint_X_p), (m.joint_child, m.joint_X_c))
            told.append([_behind(self._frame(int(body.numpy()[i])), X.numpy()[i]) for body, X in sides])
        return told + [[] for _ in self.loops[len(told) :]]

    def _touching(self) -> list[int]:
        return [i for i, flags in enumerate(self._m.shape_flags.numpy().tolist()) if flags & COLLIDES]

    def shapes(self) -> Any:
        m, told = self._m, []
        kinds, scales, bodies, places = (
            getattr(m, f"shape_{key}").numpy() for key in ("type", "scale", "body", "transform"))  # fmt: skip
        for i in self._touching():
            source = m.shape_source[i]
            points = np.array(source.vertices) * scales[i] if source is not None else np.zeros((0, 3))
            name, kind = m.shape_label[i].rpartition("/")[2], SHAPES[kinds[i]] if kinds[i] < len(SHAPES) else "other"
            told.append(
                (
                    name,
                    kind,
                    self._mover(int(bodies[i])),
                    scales[i],
                    points,
                    *_behind(self._frame(int(bodies[i])), places[i]),
                )
            )
        return told

    def contacts(self) -> Any:
        at = {shape: k for k, shape in enumerate(self._touching())}
        pairs = self._m.shape_contact_pairs.numpy().tolist()
        return [(at[i], at[j]) for i, j in pairs if i in at and j in at]

    def _numbers(self) -> dict[str, dict[str, Any]]:
        told: dict[str, dict[str, Any]] = {}
        arrays = {
            key: getattr(self._m, f"joint_{key}").numpy()
            for key in ("armature", "friction", "limit_lower", "limit_upper", "damping", "stiffness", "effort_limit")
        }
        for name, _, kind, at, dof in self.joints:
            single, dofs = kind in ("hinge", "slide"), slice(dof, dof + {"free": 6, "ball": 3}.get(kind, 1))
            values = {
                **{key: arrays[key][dofs] for key in ("armature", "friction", "damping")},
                "stiffness": arrays["stiffness"][dof],
                "rest": float(self._m.joint_rest_q.numpy()[at]) if arrays["stiffness"][dof] else 0.0,
                "lower": arrays["limit_lower"][dof] if single else -np.inf,
                "upper": arrays["limit_upper"][dof] if single else np.inf,
            }  # fmt: skip
            effort = arrays["effort_limit"][dof]
            effort = np.inf if effort >= UNSAID else effort
            values |= {"least force": -effort, "most force": effort}
            for key, value in values.items():
                every = np.atleast_1d(value).astype(float)
                told.setdefault(key, {})[name] = np.where(
                    np.abs(every) > 1e9, np.copysign(np.inf, every), every
                ).tolist()
        return told

    def place(self, q: Any, v: Any) -> None:
        wp, m, s = self._wp, self._m, self._s
        self._q, self._v = np.array(q), v
        self._shift, self._wrench = np.eye(self.nv), np.eye(self.nv)
        self._turn = np.zeros(self.nv)
        for at, _, _, p, R in self._frees:  # of a URDF one counts from where it stands, in the axes there
            self._q[at : at + 3] = R.T @ (q[at : at + 3] - p)
            self._q[at + 3 : at + 7] = _times(R.T, q[at + 3 : at + 7])
        s.joint_q.assign(self._q.astype(np.float32))
        self._newton.eval_fk(m, s.joint_q, s.joint_qd, s)
        for _, first, body, _, R in self._frees:  # its velocity is that of the centre of mass
            r = self.frames()[self._bodies[body]][1] @ m.body_com.numpy()[body]
            w, here = v[first + 3 : first + 6], slice(first, first + 6)
            self._shift[first : first + 3, first + 3 : first + 6] = np.cross(np.eye(3), -r)
            self._turn[first : first + 3] = np.cross(w, np.cross(w, r))
            axes = np.kron(np.eye(2), R.T)
            self._wrench[here] = self._shift[here]
            self._shift[here], self._turn[here] = axes @ self._shift[here], axes @ self._turn[here]
        s.joint_qd.assign((self._shift @ v).astype(np.float32))
        self._newton.eval_fk(m, s.joint_q, s.joint_qd, s)
        count, width = m.articulation_count, m.max_dofs_per_articulation
        self._M, self._g, self._h = wp.zeros((count, width, width)), wp.zeros(self.nv), wp.zeros(self.nv)
        self._newton.eval_inverse_dynamics_passive(
            m, s, mass_matrix=self._M, gravity_force=self._g, coriolis_force=self._h
        )

    def _own_mass_matrix(self) -> Any:
        M, starts = np.zeros((self.nv, self.nv)), self._m.articulation_start.numpy()
        first = [*self._m.joint_qd_start.numpy()[: self._m.joint_count].tolist(), self.nv]
        for k, block in enumerate(self._M.numpy()):
            a = first[starts[k]]
            n = min(first[starts[k + 1]] - a, len(block))  # joints that close loops stand behind those of the tree
            M[a : a + n, a : a + n] = block[:n, :n]
        return M

    def mass_matrix(self) -> Any:
        return self._shift.T @ self._own_mass_matrix() @ self._shift

    def bias(self) -> Any:
        """Forces on a free joint are in the world's axes, always; M and velocities are in the joint's."""
        own = self._g.numpy().astype(float) + self._h.numpy()
        return self._wrench.T @ own + self._shift.T @ self._own_mass_matrix() @ self._turn

    def frames(self) -> Any:
        told = {}
        for name, X in zip(self._bodies, self._s.body_q.numpy(), strict=True):
            told[name] = _behind((np.zeros(3), np.eye(3)), X)
        return told

    def _mover(self, body: int) -> str:
        """Return the joint that moves a body; none of what stands on the world."""
        while body in self._up and self._up[body][1] == FIXED:
            body = self._up[body][0]
        moved = {name: joint for joint, name, *_ in self.joints}
        return moved.get(self._bodies[body], "") if body >= 0 else ""

    def inertias(self) -> Any:
        m, frames, told = self._m, self.frames(), []
        mass, com, J = m.body_mass.numpy(), m.body_com.numpy().astype(float), m.body_inertia.numpy().astype(float)
        for i, name in enumerate(self._bodies):
            if joint := self._mover(i):
                p, R = frames[name]
                told.append((joint, float(mass[i]), p + R @ com[i], R @ J[i] @ R.T))
        return told


def _behind(frame: Any, X: Any) -> Any:
    """Return origin and rotation of what stands at p and xyzw in a frame."""
    X = np.asarray(X, dtype=float)
    x, y, z, w = X[3:] / np.linalg.norm(X[3:])
    R = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    return frame[0] + frame[1] @ X[:3], frame[1] @ R


def _times(R: Any, xyzw: Any) -> Any:
    """Return the quaternion of a rotation behind another, whose quaternion is given."""
    trace = np.trace(R)
    w = np.sqrt(max(1.0 + trace, 0.0)) / 2
    if w > 1e-6:
        u = (R[[2, 0, 1], [1, 2, 0]] - R[[1, 2, 0], [2, 0, 1]]) / (4 * w)
    else:  # half a turn: R + 1 is twice the axis by itself
        square = (R + np.eye(3)) / 2
        u = square[int(np.argmax(np.diag(square)))]
        u = u / np.linalg.norm(u)
    x, s = xyzw[:3], xyzw[3]
    return np.array([*(w * x + s * u + np.cross(u, x)), w * s - u @ x])


def _named(path: str) -> dict[str, str]:
    """Return the names of a file by what Newton makes of them: it takes letters, digits and _ alone."""
    with open(path, encoding="utf-8") as file:
        return {re.sub(r"\W", "_", name): name for name in re.findall(r"name=[\"']([^\"']*)", file.read())}


def open_robot(path: str, urdf: bool) -> _Robot:
    """Return what Newton makes of a file."""
    return _Robot(path, urdf)
