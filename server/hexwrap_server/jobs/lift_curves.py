"""``hexwrap lift``: own drawings from the unrolled domain onto the surface, and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_server.errors import DrawingError, UsageError
from hexwrap_server.input.curves import drawn as traced
from hexwrap_server.input.curves import refined
from hexwrap_server.input.readers.drawing import Curve
from hexwrap_server.output.unrolled import drawn, plane
from hexwrap_solver.arrays import Complexes, Floats
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import ConformalMap, Deck
from hexwrap_solver.domain import flatten, lift

#: Drawn lines are followed in steps of this part of the circumference.
STEPS_AROUND = 400
#: More points are not carried at once.
MOST_POINTS = 1_000_000


@dataclass(frozen=True)
class Carried:
    """curves: what arrived. outside: how many points of the drawing have no place there; farthest: the
    greatest distance of a point from the surface it was laid down from (flattening)."""

    curves: list[Curve]
    outside: int = 0
    farthest: float = 0.0


def lift_curves(cmap: ConformalMap, curves: list[Curve], step: float | None) -> Carried:
    """Curves (k, 2) of the unrolled domain onto the surface; what lies outside is cut away. Where the domain
    overlaps itself, they are meant as ``domain.dxf`` and ``domain.svg`` draw it: in pieces beside each other.

    Raises DrawingError.

    step: how closely lines are followed, in units of the domain; None: a 400th of the circumference.
    """
    cmap, _ = drawn(cmap)
    flat = [Curve(c.points[:, :2], c.closed) for c in curves]
    fine = _followed(flat, step or _once_around(cmap) / STEPS_AROUND)
    at = np.vstack([curve.points for curve in fine])
    there = lift(cmap, at[:, 0] + 1j * at[:, 1])
    ends = np.cumsum([len(curve.points) for curve in fine])[:-1]
    parts = zip(fine, np.split(there.points, ends), np.split(there.inside, ends), strict=True)
    carried = [
        piece for curve, points, inside in parts for piece in _inside(Curve(points, curve.closed), inside)
    ]
    return Carried(carried, outside=int(np.sum(~there.inside)))


def _followed(curves: list[Curve], step: float) -> list[Curve]:
    """The curves in steps. Raises DrawingError where that would be too many."""
    with np.errstate(over="ignore"):
        length = float(sum(np.linalg.norm(np.diff(traced(c), axis=0), axis=1).sum() for c in curves))
    if not length / step <= MOST_POINTS:
        raise DrawingError(
            f"The lines of the drawing are {length:.3g} long; in steps of {step:.3g} that is more than "
            f"{MOST_POINTS:,} points: draw within the domain, or choose a longer step."
        )
    return [refined(curve, step) for curve in curves]


def flatten_curves(cmap: ConformalMap, curves: list[Curve], step: float | None) -> Carried:
    """Curves (k, 3) near the surface into the unrolled domain, each in one piece over several sheets. Where
    the domain overlaps itself, as it is drawn; see ``lift_curves``."""
    if any(curve.points.shape[1] != 3 for curve in curves):
        raise UsageError("--flatten needs points in space: three numbers each.")
    cmap, _ = drawn(cmap)
    fine = _followed(curves, step) if step else curves
    found = flatten(cmap, np.vstack([curve.points for curve in fine]))
    carried = []
    ends = np.cumsum([len(curve.points) for curve in fine])[:-1]
    for curve, z in zip(fine, np.split(found.uv, ends), strict=True):
        if cmap.kind == "net":
            carried.append(Curve(plane(over_cuts(cmap.net, z)), curve.closed))
            continue
        z = one_piece(cmap.deck, z)
        # A closed curve that goes around the surface ends on another sheet than it started on.
        closed = curve.closed and bool(_turns(cmap.deck, z[[-1, 0]])[1] == 0)
        if curve.closed and not closed:
            z = np.append(z, cmap.deck.apply(z[:1], _turns(cmap.deck, z[[-1, 0]])[1:]))
        carried.append(Curve(plane(z), closed))
    return Carried(carried, farthest=float(found.distance.max(initial=0.0)))


def one_piece(deck: Deck, z: Complexes) -> Complexes:
    """Each place moved to the sheet in which it is nearest to the place before it."""
    return deck.apply(z, np.cumsum(_turns(deck, z)))


def over_cuts(net: Net, z: Complexes) -> Complexes:
    """The same on a net: where a place lies nearer to the one before it after one of the net's motions, that
    motion holds from there on."""
    z, used = z.copy(), np.unique(net.crossing)
    while True:
        images = net.apply(used[:, None], z[None, 1:])
        near = np.abs(images - z[:-1])
        best = near.argmin(axis=0)
        jumps = np.flatnonzero(near[best, np.arange(len(best))] < 0.5 * np.abs(z[1:] - z[:-1]))
        if not len(jumps):
            return z
        at = int(jumps[0])  # what lies before it stands in one piece
        z[at + 1 :] = net.apply(used[best[at]], z[at + 1 :])


def _once_around(cmap: ConformalMap) -> float:
    """Length that drawings are measured by, in the domain."""
    if cmap.kind != "net":
        return cmap.circumference
    corners = cmap.corners()
    return float(np.ptp(corners.real) + np.ptp(corners.imag))


def _turns(deck: Deck, z: Complexes) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """(k,) how many turns each place lies before the one before it; they add up, since g is an isometry."""
    shifts = np.array([0, -1, 1, -2, 2])
    near = np.abs(deck.apply(z[1:, None], shifts[None, :]) - z[:-1, None])
    return np.append(0, shifts[np.argmin(near, axis=1)])


def _inside(curve: Curve, inside: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> list[Curve]:
    """The pieces of a curve whose points are inside."""
    if inside.all():
        return [curve]
    points: Floats = curve.points
    if curve.closed:  # start behind a gap, so that no piece is cut at the start
        gap = int(np.flatnonzero(~inside)[0])
        points, inside = np.roll(points, -gap, axis=0), np.roll(inside, -gap)
    ends = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(int)))
    return [Curve(points[a:b]) for a, b in ends.reshape(-1, 2).tolist()]
