"""Features of robot files, one a file, each with the scene that it means: written here, not read by anybody.

Most are an arm of two links, told in another way; what it is to be stands beside as changes of that arm.
"""

from crossbody.cases.files.conformance import contacts, forces, inertias, joints, poses, rows, urdf
from crossbody.cases.files.conformance.arm import Feature
from crossbody.cases.files.conformance.urdf import TETRAHEDRON

__all__ = ["FEATURES", "TETRAHEDRON", "Feature"]

FEATURES = tuple(one for part in (joints, poses, inertias, forces, rows, contacts, urdf) for one in part.features())
"""All of them, in the order of the table."""
