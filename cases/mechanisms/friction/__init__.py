"""Coulomb friction: closed-form motions on a floor, and what MuJoCo's parameters make of them."""
