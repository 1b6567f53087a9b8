"""Which rows of a system rub: tangential rows of the normal rows that they follow, and rows with dry friction."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import SceneError
from crossbody.cases.arrays import distinct, frozen
from crossbody.reference.kinds import Floats, Index

SLIPPERY = float(np.finfo(float).tiny)  # the coefficient in place of 0: rows slide with forces that no sum feels


def frictional_rows(
    follows: Index, unilateral: NDArray[np.bool_], mu: Floats, loss: Floats, drift: Floats
) -> dict[str, Any]:
    """Find the tangential rows of every normal row and check that the machine can do what they ask.

    Args:
        follows: the row that each one follows (nc,), or -1.
        unilateral: whether a row may open.
        mu: coefficients of friction, infinite where a row never slides.
        loss: dry friction of a row's own, N or N m.
        drift: speeds of the surfaces along the rows, m/s or rad/s.

    Returns:
        Fields of `System` by name; each row with dry friction follows itself.

    Raises:
        SceneError: if a value is out of range, or rows are where the machine cannot have them.
    """
    nc = len(follows)
    _check_ranges(mu, loss)
    dry, own = loss > 0.0, np.arange(nc)
    slides = np.isfinite(mu) & (follows >= 0) & ~dry
    first, count, size = np.where(dry, own, -1), dry.astype(np.int64), np.where(dry, loss, 0.0)
    for normal in distinct(follows[slides]).tolist():
        rows = np.flatnonzero(slides & (follows == normal))
        if len(rows) > 2 or rows[-1] - rows[0] != len(rows) - 1 or len(set(mu[rows].tolist())) > 1:
            raise SceneError(
                f"Rows {rows.tolist()} follow row {normal} with mu = {mu[rows].tolist()}; "
                "it has one or two tangential rows, one behind the other, of one mu."
            )
        if follows[normal] >= 0 or not unilateral[normal]:
            raise SceneError(f"Row {normal} has friction; it must be able to open and follow no other.")
        # Rows without friction slide as well: left out here they would be held as long as the contact presses.
        first[normal], count[normal], size[normal] = rows[0], len(rows), max(mu[rows[0]], SLIPPERY)
    _check_dry(follows, unilateral, dry)
    if not np.all(np.isfinite(drift)) or np.any(drift[~(slides | dry)] != 0.0):
        raise SceneError(f"System.drift is {drift.tolist()}; it must be finite, and 0 except for rows with friction.")
    return {
        "follows": np.where(dry, own, follows),
        "friction_loss": loss,
        **{name: frozen("System", name, x, (nc,)) for name, x in (("mu", mu), ("friction", size), ("drift", drift))},
        **{name: frozen("System", name, x, (nc,), np.int64) for name, x in (("tangent", first), ("tangents", count))},
    }


def _check_ranges(mu: Floats, loss: Floats) -> None:
    if np.any(np.isnan(mu)) or np.any(mu < 0.0):
        raise SceneError(f"System.mu is {mu.tolist()}; it must be at least 0, infinite where a row never slides.")
    if not np.all(np.isfinite(loss)) or np.any(loss < 0.0):
        raise SceneError(f"System.friction_loss is {loss.tolist()}; it must be finite and at least 0.")


def _check_dry(follows: Index, unilateral: NDArray[np.bool_], dry: NDArray[np.bool_]) -> None:
    own = np.arange(len(follows))
    wrong = dry & (~unilateral | ((follows >= 0) & (follows != own)))
    wrong |= dry & np.isin(own, follows[(follows >= 0) & (follows != own)])
    if np.any(wrong):
        row = int(np.flatnonzero(wrong)[0])
        raise SceneError(
            f"Row {row} has dry friction of its own (System.friction_loss): it must not be always active, "
            "must not follow another row, and no row may follow it."
        )
