"""The whole way with singularities: cells close around them, panels are regular, nothing overlaps."""

import re
from dataclasses import dataclass, replace

import numpy as np
import pytest

from hexwrap_solver.arrays import Ragged, no_progress
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.errors import ConvergenceError, SingularitiesError
from hexwrap_solver.explore.predict import outlook
from hexwrap_solver.explore.worth import or_plain
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.pipeline import SolveSettings, solve
from hexwrap_solver.singularities import outlook as outlook_module
from hexwrap_solver.singularities import solve as module
from hexwrap_solver.singularities.place import Proposals
from hexwrap_solver.singularities.types import Proposal, SingularityAt, SingularitySettings
from hexwrap_solver.surface import surface_from_mesh, with_openings
from hexwrap_solver.surface.types import SentMesh, SurfaceSettings
from tests.solver.singularities import shapes

SIDES = {"hex": 6, "quad": 4, "triangle": 3}
DEGREE = {"hex": 3, "quad": 4, "triangle": 6}


def solved(surface, mode="isometric", count=None, at=(), panels=None, **pattern):
    asked = SingularitySettings(count, at) if count is not None or at else None
    settings = SolveSettings(
        BoundaryCondition(mode), PatternSettings(**pattern), panels or PanelSettings(), asked
    )
    return solve(lambda: surface, settings)


#: Two heptagons (or their like) on opposite sides of the waist.
ASIDE = (SingularityAt(-1, vertex=620), SingularityAt(-1, vertex=600))
#: Between straight ends Σ k = 0, and Σ k·turn is a whole number.
PAIRS = (*ASIDE, SingularityAt(1, vertex=220), SingularityAt(1, vertex=200))
CASES = {
    "tube": (shapes.waist, "isometric", None, ASIDE, {"around": 16}),
    "trimmed": (shapes.waist, "isometric", None, ASIDE, {"around": 16, "boundary": "trim"}),
    "octagon": (shapes.waist, "isometric", None, (SingularityAt(-2, vertex=620),), {"around": 16}),
    "triangles": (shapes.waist, "isometric", None, ASIDE, {"kind": "triangle", "around": 32}),
    "quads": (shapes.waist, "isometric", None, ASIDE, {"kind": "quad", "around": 16}),
    "closed": (shapes.ellipsoid, "straight", None, (), {"edge_length": 0.2}),
    "both ends aligned": (shapes.waist, "straight", None, PAIRS, {"around": 20, "align": "both"}),
}


@pytest.fixture(scope="module", params=CASES)
def case(request):
    make, mode, count, at, pattern = CASES[request.param]
    return request.param, solved(make(), mode, count, at, **pattern)


def test_the_pattern_has_the_singularities_of_the_map(case):
    _, solution = case
    cones, laid = solution.map.cones, solution.pattern
    assert len(cones) > 0
    singular = [] if laid.kind == "triangle" else sorted(cones.index)
    assert sorted(laid.index[laid.index != 0]) == singular
    lengths = laid.faces.lengths[laid.whole]
    assert (lengths == SIDES[laid.kind] - laid.index[laid.whole]).all()


def test_interior_nodes_are_regular(case):
    _, solution = case
    laid = solution.pattern
    if not laid.whole.all():  # cut cells share nodes with others along the boundary
        return
    inner = np.ones(len(laid.vertices), dtype=bool)
    edge = laid.neighbours.values < 0
    inner[laid.faces.values[edge]] = False
    inner[laid.faces.values[laid.faces.next()[edge]]] = False
    valence = np.bincount(laid.faces.values, minlength=len(laid.vertices))[inner]
    regular = DEGREE[laid.kind]
    odd = sorted(regular - valence[valence != regular])
    assert odd == (sorted(solution.map.cones.index) if laid.kind == "triangle" else [])


def test_the_map_is_conformal(case):
    """Lengths are e^((u_i + u_j)/2)·l_ij and angle sums 2π − k·quantum, also where the lattice lies on a
    stretched chart."""
    name, solution = case
    cmap = solution.map
    faces, z, u = cmap.surface.faces, cmap.corners(), cmap.log_scale
    following = np.roll(faces, -1, axis=1)
    length = np.linalg.norm(cmap.surface.vertices[faces] - cmap.surface.vertices[following], axis=2)
    edge = np.roll(z, -1, axis=1) - z
    assert np.abs(edge) == pytest.approx(np.exp((u[faces] + u[following]) / 2) * length, rel=1e-9)
    angle = np.angle(-np.roll(edge, 1, axis=1) / edge)
    assert angle.min() > 0
    sums = np.bincount(faces.ravel(), angle.ravel())
    wanted = np.full(len(u), 2 * np.pi)
    wanted[cmap.cones.vertex] -= cmap.cones.curvature
    for loop, angles in zip(cmap.surface.loops, cmap.boundary_angles, strict=True):
        wanted[loop] = angles
        if name == "both ends aligned":
            assert angles == pytest.approx(np.pi, abs=1e-9)
    assert sums == pytest.approx(wanted, abs=1e-9)


def test_nothing_is_deformed(case):
    """But for the stretch that makes both ends lattice lines."""
    name, solution = case
    both = name == "both ends aligned"
    assert (solution.map.fitted.chart is not None) == both
    assert 0 < solution.pattern.distortion < 0.01 if both else solution.pattern.distortion == 0
    moved = solution.map.cones.moved
    width = (
        solution.pattern.edge_length * {"hex": np.sqrt(3), "quad": 1, "triangle": 1}[solution.pattern.kind]
    )
    assert moved.max() < 1.3 * width, name


def test_panels_are_regular_and_do_not_overlap(case):
    _, solution = case
    panels, quality = solution.panels, solution.quality
    assert quality.overlaps == 0
    if solution.pattern.kind == "hex":
        regular = panels.whole
        assert quality.planarity[regular].max() < 1e-9
        assert quality.edge_deviation[regular].max() < 1e-9
        assert quality.angle_deviation[regular].max() < 1e-9


def test_special_panels_are_types_of_their_own(case):
    _, solution = case
    panels, laid = solution.panels, solution.pattern
    special = np.flatnonzero(laid.index[panels.face] != 0)
    n = panels.n_sizes
    assert n <= 11
    assert (panels.size[special] >= n).all()
    assert len(np.unique(panels.size[special])) == len(special)
    assert (panels.class_sides[panels.size[special]] == panels.polygons.lengths[special]).all()
    assert (panels.class_sides[:n] == SIDES[laid.kind]).all()
    assert panels.class_count.sum() == (panels.size >= 0).sum()


def test_listed_ones_stand_where_they_were_listed():
    surface = shapes.waist()
    found = solved(surface, at=ASIDE, around=16)
    assert sorted(found.map.cones.index) == [-1, -1]
    place = found.map.surface.vertices[found.map.cones.vertex]
    away = np.linalg.norm(place[:, None] - surface.vertices[[620, 600]], axis=2).min(axis=1)
    assert away == pytest.approx(found.map.cones.moved, abs=1e-9)
    assert (found.map.surface.input_vertex[found.map.cones.vertex] == -1).all()


def test_none_where_none_pays():
    found = solved(shapes.straight(), count="auto", around=16)
    assert found.map.kind == "cylinder"
    assert len(found.map.cones) == 0


@pytest.mark.parametrize(("surface", "pay"), [(shapes.waist(), True), (shapes.straight(), False)])
def test_never_worse_than_without(surface, pay):
    """Two heptagons save sizes on the waist (below six, of large cells); needed nowhere, they make them."""
    condition, pattern = BoundaryCondition("isometric", quantum="hex"), PatternSettings(around=16)
    n = len(surface.vertices)
    at = tuple(SingularityAt(-1, vertex=n // 2 + i) for i in (0, 20))
    seats = module.seated(surface, condition, SingularitySettings(at=at), pattern, 4)
    cmap = module.closed_map(surface, seats.frame, seats.placing, condition)
    taken = or_plain(cmap, surface, condition, pattern, 4)
    assert (taken is cmap) == pay
    assert pay or (not len(taken.cones) and "left out" in taken.notes[-1])
    left = [outlook(one, pattern).foresee(4).uncovered for one in (taken, conformal_map(surface, condition))]
    assert left[0] <= left[1]


def test_too_few_are_refused():
    with pytest.raises(
        SingularitiesError, match="No 3 singularities or fewer can make the angles of this surface add up"
    ):
        solved(shapes.ellipsoid(), count=3, around=20)


def lobed(rows: int = 31, around: int = 40):
    """A tube with a waist and no symmetry that would save sizes."""
    plain = shapes.waist(rows, around)
    x, y, z = plain.vertices.T
    wide = 1 + 0.25 * np.cos(2 * np.arctan2(y, x) + 0.4 * z)
    return shapes.surface_of(np.stack([x * wide, y * wide, z + 0.1 * x], axis=1), plain.faces)


@pytest.fixture(scope="module")
def found():
    return solved(lobed(), count="auto", around=24)


@pytest.fixture(scope="module")
def plain():
    return solved(lobed(), mode="straight", around=24)


FORESEEN = r"(\d+) .* would leave less than ([\d.]+)% .* ask for singularities (\d+) "


def test_what_singularities_would_leave_of_a_pointed_body_is_told_as_a_bound():
    """Cells grow at its tip as much as they like, which no patch of the coarse model shows."""
    surface = shapes.gherkin()
    plain = solved(surface, mode="auto")
    said = [re.search(FORESEEN, note) for note in plain.quality.notes if "would leave less than" in note]
    assert len(said) == 1
    then = solved(surface, count=int(said[0][3])).quality
    assert 1 - then.coverage < float(said[0][2]) / 100
    assert then.bare < 0.05 < plain.quality.bare


def test_says_what_singularities_would_bring(plain, found):
    said = [note for note in plain.quality.notes if "would leave less than" in note]
    assert len(said) == 1
    told, most, asked = re.search(FORESEEN, said[0]).groups()
    assert told == asked
    then = solved(lobed(), count=int(asked), around=24)
    assert 0 < len(then.map.cones) <= int(told)
    assert 1 - then.quality.coverage < float(most) / 100
    assert found.quality.coverage > plain.quality.coverage
    assert not any("would leave less than" in note for note in found.quality.notes)
    even = solved(shapes.straight(), mode="straight", around=16)
    assert not any("would leave less than" in note for note in even.quality.notes)


def test_says_so_of_any_number_of_vertices():
    """Fewer places are looked at on a fine mesh, for the time not to grow with it; what is told is true."""
    fine = lobed(160, 250)
    assert len(fine.vertices) == 40_000
    seats = len(outlook_module.seats(fine, "hex").model.seat)
    assert outlook_module.FEWEST <= seats < outlook_module.PATCHES
    plain = solved(fine, mode="straight", around=24)
    said = [re.search(FORESEEN, note) for note in plain.quality.notes if "would leave less than" in note]
    assert len(said) == 1
    then = solved(lobed(), count=int(said[0][3]), around=24)
    assert 1 - then.quality.coverage < float(said[0][2]) / 100


def test_the_curve_of_sizes_counts_no_singularities(found):
    assert found.panels.n_special == len(found.map.cones) > 0
    assert found.panels.trade_off.taken == len(found.panels.class_length) - found.panels.n_special


class TestCurve:
    def test_what_was_taken_is_measured(self, found):
        curve = found.quality.singularities
        assert curve.uncovered[curve.taken] == 1 - found.quality.coverage
        assert curve.number[curve.taken] == len(found.map.cones)
        assert (np.diff(curve.number) > 0).all()
        assert curve.number[0] == 0
        assert len(curve.places[0]) == 0

    def test_each_point_can_be_asked_for(self, found):
        curve = found.quality.singularities
        i = curve.taken
        at = tuple(
            SingularityAt(int(k), point=tuple(place.tolist()))
            for place, k in zip(curve.places[i], curve.index[i], strict=True)
        )
        again = solved(lobed(), at=at, around=24)
        assert again.map.cones.index.tolist() == found.map.cones.index.tolist()
        assert again.quality.coverage == pytest.approx(found.quality.coverage, abs=1e-4)

    def test_a_coarse_one_without_any(self, plain):
        curve = plain.quality.singularities
        assert curve.coarse
        assert curve.taken == 0
        assert curve.uncovered[0] == 1 - plain.quality.coverage
        assert curve.uncovered.min() < 0.7 * curve.uncovered[0]


@pytest.mark.parametrize("index", [1, 2, -1, -2])
def test_triangles_meet_in_a_vertex_of_another_valence(index):
    found = solved(
        shapes.waist(), "isometric", None, (SingularityAt(index, vertex=620),), kind="triangle", around=24
    ).pattern
    side = np.flatnonzero(found.neighbours.values < 0)
    inner = np.ones(len(found.vertices), dtype=bool)
    inner[found.faces.values[side]] = inner[found.faces.values[found.faces.next()[side]]] = False
    valence = np.bincount(found.faces.values, minlength=len(found.vertices))
    assert sorted(6 - valence[inner & (valence != 6)]) == [index]
    edges = (len(found.faces.values) + len(side)) // 2
    assert len(found.vertices) - edges + found.n_cells == 0


def test_a_closed_surface_takes_triangles():
    laid = solved(shapes.ellipsoid(), "straight", kind="triangle", edge_length=0.3).pattern
    assert (laid.neighbours.values >= 0).all()
    assert len(laid.vertices) - len(laid.faces.values) // 2 + laid.n_cells == 2
    valence = np.bincount(laid.faces.values)
    assert (6 - valence).sum() == 12


@pytest.mark.parametrize(
    ("kind", "index", "said"),
    [
        ("quad", 2, "would leave 2 sides around it in a quad pattern"),
        ("brick", 1, "no rotations but half turns"),
    ],
)
def test_what_closes_around_nothing_is_refused(kind, index, said):
    with pytest.raises(SingularitiesError, match=said):
        solved(shapes.waist(), "isometric", None, (SingularityAt(index, vertex=620),), kind=kind, around=24)


@pytest.mark.parametrize("count", ["auto", 4])
def test_where_they_cannot_be_closed_there_are_none(monkeypatch, count):
    """A number asked for is the most that there may be."""

    def fails(*args):
        raise ConvergenceError("It did not close.")

    monkeypatch.setattr(module, "closed_at", fails)
    found = solved(shapes.waist(), count=count, around=16)
    assert len(found.map.cones) == 0
    assert any("left out: It did not close." in note for note in found.quality.notes)
    assert found.quality.singularities.number[found.quality.singularities.taken] == 0


def test_where_they_cannot_be_moved_the_pattern_is_bent(monkeypatch):
    """A closed surface, and places that are asked for, cannot go without: the map is still conformal, and the
    pattern closes."""

    def fails(*args):
        raise ConvergenceError("It did not close.")

    monkeypatch.setattr(module, "closed_at", fails)
    found = solved(shapes.ellipsoid(), kind="triangle", edge_length=0.3)
    assert len(found.map.cones) == 12
    assert found.map.fitted is None
    assert found.map.residual < 1e-9
    laid = found.pattern
    assert 0 < laid.distortion < 0.5
    assert (laid.neighbours.values >= 0).all()
    assert len(laid.vertices) - len(laid.faces.values) // 2 + laid.n_cells == 2
    assert any("bent beside them" in note for note in found.quality.notes)
    listed = solved(shapes.waist(), count=None, at=(SingularityAt(1, vertex=200),), around=16)
    assert listed.map.cones.index.tolist() == [1]


@dataclass(frozen=True)
class Made:
    """Stands for a map."""

    count: int
    notes: tuple[str, ...] = ()


def first_that_closes(monkeypatch, failing):
    """The map that is made where so many attempts fail, and those attempts' numbers."""
    asked = []

    def close(surface, frame, proposal, progress, work):
        asked.append(proposal.count)
        if len(asked) <= failing:
            raise ConvergenceError(f"Reason {len(asked)}.")
        return None, None

    monkeypatch.setattr(module, "closed_at", close)
    monkeypatch.setattr(
        module, "as_map", lambda frame, chart, found, placing, _: Made(placing.proposal.count)
    )
    proposals = tuple(
        Proposal(np.arange(n), np.ones(n, dtype=np.int64), (), 0.1, 0.1, 1.0) for n in (10, 12, 14)
    )
    frame = module.Frame(LATTICES["hex"], None, 1.0, None, (), None, 0.05)
    placing = Proposals(proposals, 1, others=(2, 0))
    return module.first_that_closes(None, frame, placing, no_progress, module.Work(1)), asked


def test_where_those_chosen_do_not_close_others_do(monkeypatch):
    made, asked = first_that_closes(monkeypatch, 0)
    assert asked == [12]
    assert not made.notes
    made, _ = first_that_closes(monkeypatch, 1)
    assert made.count == 14
    assert any("12 pentagons" in note and "cannot be moved" in note for note in made.notes)
    with pytest.raises(ConvergenceError, match=r"^Reason 1\.$"):
        first_that_closes(monkeypatch, 2)


def windowed():
    """The waist with a hole in its side, between two rings."""
    whole = shapes.waist()
    hole = np.isin(whole.faces, [900, 901, 902, 941, 942]).any(axis=1)
    return shapes.surface_of(whole.vertices, whole.faces[~hole])


def test_without_singularities_loops_keep_the_curvatures_that_were_chosen():
    surface = windowed()
    surface = replace(surface, loops=tuple(sorted(surface.loops, key=len, reverse=True)))
    frame = module.frame_of(
        surface, BoundaryCondition("isometric", quantum="hex"), SingularitySettings(1), None, 11
    )
    none = np.zeros(0, dtype=np.int64)
    placing = Proposals((Proposal(none, none, (2, -2, -6), 0.1, 0.1, 2.0),), 0)
    cmap = module.closed_map(surface, frame, placing, BoundaryCondition("isometric", quantum="hex"))
    for loop, angles, quanta in zip(surface.loops, cmap.boundary_angles, (2, -2, -6), strict=True):
        assert np.ptp(cmap.log_scale[loop]) < 1e-9
        assert (np.pi - angles).sum() == pytest.approx(quanta * np.pi / 3, abs=1e-7)


def test_a_box_of_eight_vertices_has_places_for_small_cells():
    """All its vertices lie on creases, from which singularities keep away where they can."""
    corner = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=float)
    quads = [[3, 2, 1, 0], [4, 5, 6, 7], *([k, (k + 1) % 4, (k + 1) % 4 + 4, k + 4] for k in range(4))]
    sent = SentMesh(corner, Ragged.from_table(np.array(quads)))
    surface = surface_from_mesh(sent, SurfaceSettings(caps="keep"))

    def seated(kind):
        cells = PatternSettings(kind=kind, edge_length=0.02)
        return module.seated(surface, BoundaryCondition(), SingularitySettings(), cells, 11).placing

    assert seated("quad").proposal.index.tolist() == [1] * 8
    with pytest.raises(SingularitiesError, match="8 vertices for them to stand at"):
        seated("hex")


def test_openings_that_are_cut_are_wall_for_singularities():
    """These are closed on the wall with its opening filled, whose rim stays where it is."""
    surface = with_openings(windowed(), "cut")
    solution = solved(surface, at=ASIDE, around=16)
    cmap = solution.map
    assert len(cmap.surface.loops) == 3
    assert len(cmap.cones) == 2
    rim = cmap.surface.vertices[cmap.surface.loops[2]]
    assert (np.sort(rim, axis=0) == np.sort(surface.vertices[surface.loops[2]], axis=0)).all()
    assert solution.quality.overlaps == 0
    assert solution.pattern.distortion < 1e-6
