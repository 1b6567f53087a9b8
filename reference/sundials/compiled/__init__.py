"""The equations and guards of the SUNDIALS solvers in compiled code; it calls nothing of the compiled loop."""
