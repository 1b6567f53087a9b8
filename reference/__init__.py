"""The reference model: constrained dynamics with contact as a hybrid penalty DAE."""
