"""What runs beside crossbody, in an interpreter that has NumPy and the engine: it imports nothing else of ours."""
