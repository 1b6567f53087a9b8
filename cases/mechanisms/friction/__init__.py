"""Coulomb friction: bodies on a floor whose motions have closed forms, and what MuJoCo's parameters make of them."""
