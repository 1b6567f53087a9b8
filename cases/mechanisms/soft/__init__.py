"""The soft contact: scene, the variant on a robot, closed forms, claims."""
