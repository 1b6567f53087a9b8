"""The compiled integrator: one machine-code program that serves every mechanism.

layout        what a run remembers; the workspace, carved once from two flat arrays
algebra       mass matrix by blocks and trees, Schur complement: their factors
acceleration  v' and lam of the active rows
dop853        explicit step of order 8 with dense output of order 7
esdirk        L-stable implicit step of order 4 for what is stiff
exact         closed-form arcs if the scene is affine
dense         the state anywhere inside the step just taken
machine       the state machines: what is switched at an instant
events        where inside a step a machine must switch
record        what is written down
advance       the loop
"""
