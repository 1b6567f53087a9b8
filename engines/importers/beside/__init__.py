"""What runs beside crossbody, in an interpreter that has NumPy and the engine: it imports no more of ours."""
