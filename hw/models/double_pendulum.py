"""A double pendulum; the defaults are those published with MultiArm-Pendulum (Kaheman et al. 2022)."""

from __future__ import annotations

from crossbody.hw.models._links import links

MODEL = links(
    "double_pendulum",
    "Double pendulum with viscous and dry friction",
    {
        "gravity": 9.808580233621502, "m1": 0.09384397479834065, "a1": 0.10856521461039578,
        "L1": 0.17271920381751893, "I1": 0.00043752942975691005, "k1": 0.00023714278269358068,
        "m2": 0.13759597049941155, "a2": 0.11677901844565573, "L2": 0.23355803689131146,
        "I2": 0.001268829392577409, "k2": 1.0000001933055762e-05,
    },
    count=2,
    restart=2.0,
)  # fmt: skip
