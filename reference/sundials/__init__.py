"""The same runs by SUNDIALS and plain Python: the independent check on the compiled loop."""
