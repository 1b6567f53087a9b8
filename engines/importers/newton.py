"""Newton's readers of robot files: `newton.ModelBuilder.add_mjcf` and `add_urdf`, in single precision."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

FORMATS, PACKAGE, MODULE = ("mjcf", "urdf"), "newton", "newton"
KINDS = {0: "slide", 1: "hinge", 2: "ball", 4: "free"}
FIXED = 3


class _Robot:
    free, ball = "p, xyzw; world, world", "xyzw; parent"
    hidden = {"energy": "Newton tells no energy."}  # noqa: RUF012
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
        loops = (m.joint_articulation.numpy() < 0).tolist()
        kinds, self._child, at, first = (
            getattr(m, f"joint_{key}").numpy() for key in ("type", "child", "q_start", "qd_start")
        )
        self._up = dict(
            zip(
                self._child.tolist(),
                zip(m.joint_parent.numpy().tolist(), kinds.tolist(), last, strict=True),
                strict=True,
            )
        )
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
                self._frees.append((int(first[i]), int(self._child[i])))
        self.actuators: dict[str, list[str]] = {}
        self.hidden = self.hidden | {"actuators": "Newton's actuators carry no names of the file's."}
        equalities = getattr(m.mujoco, "equality_constraint_count", 0) if hasattr(m, "mujoco") else 0
        self.loops = max(sum(loops) + len(m.constraint_mimic_label), int(equalities))
        self.numbers = self._numbers()

    def _numbers(self) -> dict[str, dict[str, Any]]:
        told: dict[str, dict[str, Any]] = {}
        arrays = {
            key: getattr(self._m, f"joint_{key}").numpy()
            for key in ("armature", "friction", "limit_lower", "limit_upper", "damping", "stiffness")
        }
        for name, _, kind, at, dof in self.joints:
            single = kind in ("hinge", "slide")
            values = {
                **{key: arrays[key][dof] for key in ("armature", "friction", "damping", "stiffness")},
                "rest": float(self._m.joint_rest_q.numpy()[at]) if arrays["stiffness"][dof] else 0.0,
                "lower": arrays["limit_lower"][dof] if single else -np.inf,
                "upper": arrays["limit_upper"][dof] if single else np.inf,
            }  # fmt: skip
            for key, value in values.items():
                told.setdefault(key, {})[name] = [float(np.sign(value) * np.inf if abs(value) > 1e9 else value)]
        return told

    def place(self, q: Any, v: Any) -> None:
        wp, m, s = self._wp, self._m, self._s
        self._shift = np.eye(self.nv)
        self._turn = np.zeros(self.nv)
        s.joint_q.assign(q.astype(np.float32))
        self._newton.eval_fk(m, s.joint_q, s.joint_qd, s)
        for first, body in self._frees:  # its velocity is that of the centre of mass
            r = self.frames()[self._bodies[body]][1] @ m.body_com.numpy()[body]
            w = v[first + 3 : first + 6]
            self._shift[first : first + 3, first + 3 : first + 6] = np.cross(np.eye(3), -r)
            self._turn[first : first + 3] = np.cross(w, np.cross(w, r))
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
        own = self._g.numpy().astype(float) + self._h.numpy()
        return self._shift.T @ (own + self._own_mass_matrix() @ self._turn)

    def energy(self) -> float:
        return float("nan")

    def frames(self) -> Any:
        told = {}
        for name, X in zip(self._bodies, self._s.body_q.numpy().astype(float), strict=True):
            x, y, z, w = X[3:] / np.linalg.norm(X[3:])
            R = np.array([
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ])  # fmt: skip
            told[name] = (X[:3], R)
        return told

    def inertias(self) -> Any:
        m, frames, told = self._m, self.frames(), []
        mass, com, J = m.body_mass.numpy(), m.body_com.numpy().astype(float), m.body_inertia.numpy().astype(float)
        moved = {body: name for name, body, *_ in self.joints}
        for i, name in enumerate(self._bodies):
            up = i
            while up in self._up and self._up[up][1] == FIXED:
                up = self._up[up][0]
            joint = moved.get(self._bodies[up]) if up >= 0 else None
            if joint is not None:
                p, R = frames[name]
                told.append((joint, float(mass[i]), p + R @ com[i], R @ J[i] @ R.T))
        return told


def _named(path: str) -> dict[str, str]:
    """Return the names of a file by what Newton makes of them: it takes letters, digits and _ alone."""
    with open(path, encoding="utf-8") as file:
        return {re.sub(r"\W", "_", name): name for name in re.findall(r"name=[\"']([^\"']*)", file.read())}


def open_robot(path: str, urdf: bool) -> _Robot:
    """Return what Newton makes of a file."""
    return _Robot(path, urdf)
