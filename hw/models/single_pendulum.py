"""A single pendulum; the defaults are those published with MultiArm-Pendulum (Kaheman et al. 2022)."""

from __future__ import annotations

from crossbody.hw.models._links import links

MODEL = links(
    "single_pendulum",
    "Single pendulum with viscous and dry friction",
    {
        "gravity": 9.81001310127465, "m1": 0.1475845717930773, "a1": 0.14775490106282646,
        "L1": 0.29550980212565292, "I1": 0.00010911850520768577, "k1": 0.0002239401254935462,
    },
    count=1,
    restart=5.0,
)  # fmt: skip
