"""What became of each feature: the vertices of the pattern on it, the cells cut there, and at what price."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Bools, Ints, Ragged
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.geometry import pair_key
from hexwrap_solver.pattern.lay.cells import Cells
from hexwrap_solver.pattern.place.choose import PlacementFamily
from hexwrap_solver.pattern.place.deform import derivatives
from hexwrap_solver.pattern.place.placement import Placement
from hexwrap_solver.pattern.trim.folds import Seams
from hexwrap_solver.pattern.types import PatternFeature
from hexwrap_solver.surface.features import FeatureEdges
from hexwrap_solver.tolerances import RELATIVE
from hexwrap_solver.words import were


def on_features(
    cmap: ConformalMap,
    placing: PlacementFamily,
    placement: Placement,
    seams: Seams | None,
    cells: Cells,
    corner: Ints,
    whole: Bools,
) -> tuple[PatternFeature, ...]:
    """One for each feature of the surface, in order. corner: vertex of each corner of the cells. whole: (c,)
    of the cells."""
    features = cmap.surface.features
    numbers = np.array(sorted(placing.features), dtype=np.int64)
    width = {chain.feature: chain.width / placing.cell for chain in placing.chains}
    vertex = np.full(int(cells.corner.values.max(initial=0)) + 1, -1, dtype=np.int64)
    vertex[cells.corner.values] = corner
    price = _prices(cmap, placement) if placement.straight else None
    found = []
    for i, feature in enumerate(features):
        chain = np.zeros(0, dtype=np.int64)
        if seams is not None and i in placing.features:
            point = seams.point[seams.on[numbers[seams.feature] == i]]
            chain = vertex[point[point < len(vertex)]]
            chain = chain[chain >= 0]
            chain = chain[np.append(True, chain[1:] != chain[:-1])] if len(chain) else chain
        beside = None
        if price is not None and i in placement.straight:
            half_edge = FeatureEdges.of(cmap.surface, (feature,)).half_edge
            faces = np.concatenate([half_edge // 3, cmap.surface.twin[half_edge] // 3])
            beside = float(np.quantile(price[faces], 0.99)) if len(faces) else None
        found.append(
            PatternFeature(
                vertices=chain,
                straight=i in placement.straight,
                cut=_cut_along(chain, corner, cells.corner, whole),
                width=width.get(i, 0.0),
                distortion=beside,
                fold=feature.fold,
            )
        )
    return tuple(found)


def _prices(cmap: ConformalMap, placement: Placement) -> np.ndarray:
    """(m,) ratios of singular values − 1."""
    change = derivatives(cmap, placement.glued)
    bent, kept = change.strains(placement.place, change.of_shift(placement.glued.shift))
    return np.asarray(2 * bent / np.maximum(kept - bent, RELATIVE * kept))


def _cut_along(chain: Ints, corner: Ints, shape: Ragged, whole: Bools) -> int:
    """Number of cells that are not whole and have a side along a chain of vertices."""
    if len(chain) < 2:
        return 0
    size = int(corner.max()) + 1
    pairs = np.minimum(chain[1:], chain[:-1]) * size + np.maximum(chain[1:], chain[:-1])
    following = corner[shape.next()]
    side = pair_key(corner, following, size)
    rows = np.unique(shape.row[np.isin(side, pairs)])
    return int((~whole[rows]).sum())


def feature_notes(features: tuple[PatternFeature, ...]) -> list[str]:
    """One sentence on all that lie on lines of the pattern."""
    straight = [feature for feature in features if feature.straight]
    if not straight:
        return []
    cut, folds = sum(feature.cut for feature in straight), [np.rad2deg(f.fold) for f in straight]
    worst = max(feature.distortion or 0.0 for feature in straight)
    one = len(straight) == 1
    beside = f", at a distortion of {worst:.2g} beside them" if worst > RELATIVE else ""
    angle = f"{min(folds):.0f}°" if np.ptp(folds) < 1 else f"{min(folds):.0f}° to {max(folds):.0f}°"
    folded = f" (folded by {angle})" if max(folds) >= 1 else ""  # drawn lines may lie flat
    return [
        f"{len(straight)} {'feature' if one else 'features'}{folded} "
        f"{'lies' if one else 'lie'} on lines of the pattern; {were(cut, 'cell')} cut there{beside}."
    ]
