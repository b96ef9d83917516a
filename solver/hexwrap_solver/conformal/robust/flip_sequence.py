"""The flips between two triangulations: points follow them forward, vectors are led back.

Points go from the first triangulation to the last one (``transport``); vectors of half-edges of the last one
become vectors of the first one (``unflip``).
"""

from __future__ import annotations

from dataclasses import dataclass, field

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.robust import delaunay, transport, unflip
from hexwrap_solver.conformal.robust.metric import Metric
from hexwrap_solver.conformal.robust.mirror import MirrorMesh
from hexwrap_solver.conformal.robust.transport import Places


@dataclass(frozen=True)
class _Round:
    """Independent flips: (k,) edges flipped across and up; (k,) outer half-edges of those that went down."""

    across: Ints
    up: Ints
    down: Ints


@dataclass
class FlipSequence:
    """All flips from one triangulation to another, in the order in which they were done.

    with_points: whether points are to follow, which takes lengths from before and after each round.
    """

    with_points: bool = False
    _rounds: list[_Round] = field(default_factory=list)
    _steps: list[transport.Flips] = field(default_factory=list)

    def flip(self, mesh: MirrorMesh, edges: Ints, length: Floats, euclidean: bool) -> None:
        """``delaunay.flip``, recorded."""
        flips = _Round(*delaunay.kinds(mesh, edges))
        kinds = (transport.up, flips.up), (transport.down, flips.down), (transport.across, flips.across)
        started = [kind(mesh, which, length) for kind, which in kinds if self.with_points and len(which)]
        delaunay.flip(mesh, edges, length, euclidean)
        self._rounds.append(flips)
        self._steps += [finish(length, euclidean) for finish in started]

    def transport(self, places: Places, size: int) -> Places:
        """Where points of the first triangulation are in the last one. size: number of half-edges."""
        return transport.transport(places, self._steps, size)

    def undo(self, mesh: MirrorMesh, metric: Metric) -> Complexes:
        """(2e,) the vector of every half-edge of the first triangulation, in its triangle's frame. Makes the
        last one, with its metric, the first again."""
        vector = unflip.half_edge_vectors(mesh, metric)
        for flips in reversed(self._rounds):
            unflip.undo_across(mesh, flips.across, vector)
            unflip.undo_down(mesh, flips.down, vector)
            unflip.undo_up(mesh, flips.up, vector)
        mesh.flipped()
        return vector
