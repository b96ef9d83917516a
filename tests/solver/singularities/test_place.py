"""Where singularities go: the laws they obey first, then what they bring on surfaces that one understands."""

from dataclasses import replace

import numpy as np
import pytest

from hexwrap_solver.conformal.energy import Energy
from hexwrap_solver.conformal.fixed import minimise
from hexwrap_solver.errors import SettingError, SingularitiesError
from hexwrap_solver.singularities.linear import Steepness, distance_to, linear_model, targets, vertex_areas
from hexwrap_solver.singularities.place import NEAREST, given, place
from hexwrap_solver.singularities.search import Search, State
from hexwrap_solver.singularities.sizes import uncovered, uncovered_of_many
from hexwrap_solver.singularities.symmetry import symmetries
from hexwrap_solver.singularities.types import Rules, SingularityAt
from tests.solver.singularities import shapes

SIXTH = np.pi / 3


def cell_of(surface, cells):
    return float(np.sqrt(2 / np.sqrt(3) * vertex_areas(surface).sum() / cells))


def rules_for(surface, ends, cells=400, **more):
    return Rules(SIXTH, cell_of(surface, cells), 11, ends, **more)


@pytest.fixture(scope="module")
def waist():
    return shapes.waist()


@pytest.fixture(scope="module")
def on_waist(waist):
    return place(waist, rules_for(waist, ("free", "free")))


def test_few_cells_bring_singularities_nearer_to_each_other():
    surface = shapes.ellipsoid()
    rules = rules_for(surface, (), cells=80, most=12)
    at = surface.vertices[place(surface, rules).proposal.vertex]
    assert len(at) == 12
    least = np.linalg.norm(at[:, None] - at, axis=2)[np.triu_indices(12, 1)].min() / rules.cell
    assert NEAREST - 0.1 <= least < rules.apart


@pytest.mark.parametrize(
    ("make", "ends", "most"),
    [
        (shapes.waist, ("free", "free"), 4),
        (shapes.waist, ("straight", "free"), 3),
        (shapes.waist, ("straight", "straight"), 4),
        (shapes.dome, ("free",), 3),
        (shapes.ellipsoid, (), 12),
    ],
)
def test_curvatures_add_up(make, ends, most):
    surface = make()
    rules = rules_for(surface, ends, most=most)
    found = place(surface, rules).proposals
    assert found
    for one in found:
        assert sum(one.loops) + one.index.sum() == 6 * (2 - len(ends))
        assert all(
            curvature == 0 for curvature, end in zip(one.loops, ends, strict=True) if end == "straight"
        )


def test_numbers_ascend_up_to_the_most(on_waist):
    assert [one.count for one in on_waist.proposals] == list(range(7))


def test_heptagons_where_a_tube_has_a_waist(on_waist):
    best = on_waist.proposal
    assert (best.index == -1).all()
    assert best.count >= 4
    assert best.uncovered < on_waist.proposals[0].uncovered
    assert best.spread < 0.4 * on_waist.proposals[0].spread
    assert sum(best.loops) == best.count


def test_none_where_none_pays():
    surface = shapes.straight()
    found = place(surface, rules_for(surface, ("free", "free"), 200, most=3))
    assert found.proposal.count == 0
    assert found.proposal.uncovered < 1e-3


def test_at_most_the_number_asked_for(waist):
    found = place(waist, rules_for(waist, ("free", "free"), most=4), 2)
    assert found.proposal.count <= 2
    assert found.proposal.uncovered == min(one.uncovered for one in found.proposals[:3])


def test_the_linear_model_predicts_the_map(waist, on_waist):
    one = on_waist.proposals[4]
    wanted = targets(waist, ("free", "free"), one.loops, SIXTH, one.vertex, one.index)
    u = minimise(Energy(waist, wanted)).u
    weight = vertex_areas(waist) / vertex_areas(waist).sum()
    spread = np.sqrt(weight @ (u - weight @ u) ** 2)
    assert spread == pytest.approx(one.spread, rel=0.1)
    search = Search(
        linear_model(waist, rules_for(waist, ("free", "free"))), rules_for(waist, ("free", "free"))
    )
    misfit = float(search.misfit(search.scale(search.settled([State((), (), (0,))])[0][1])))
    assert 0 < misfit < 0.1
    assert uncovered(u, weight, 11) < one.uncovered < uncovered(u, weight, 11) + misfit


def test_the_quadratic_form_is_the_variance(waist):
    search = Search(
        linear_model(waist, rules_for(waist, ("free", "free"))), rules_for(waist, ("free", "free"))
    )
    state = State.of([(3, -1), (40, 1), (77, -1)], (2,))
    u, weight = search.scale(state), search.model.weight
    assert search.value(state) == pytest.approx(weight @ (u - weight @ u) ** 2)


def test_another_numbering_gives_the_same_places():
    surface = shapes.dome()
    other, new = shapes.renumbered(surface, 5)
    rules = rules_for(surface, ("free",), most=2)
    for one, two in zip(place(surface, rules).proposals, place(other, rules).proposals, strict=True):
        assert sorted(new[one.vertex]) == two.vertex.tolist()
        assert one.loops == two.loops
        assert two.uncovered == pytest.approx(one.uncovered, rel=1e-6)


def test_the_same_again(waist, on_waist):
    again = place(waist, rules_for(waist, ("free", "free")))
    for one, two in zip(on_waist.proposals, again.proposals, strict=True):
        assert (one.vertex == two.vertex).all()
        assert one.loops == two.loops


def test_distances_hold(waist, on_waist):
    rules = rules_for(waist, ("free", "free"))
    rim = waist.vertices[np.concatenate(waist.loops)]
    for one in on_waist.proposals[1:]:
        at = waist.vertices[one.vertex]
        assert np.linalg.norm(at[:, None] - rim, axis=2).min() >= rules.from_loops * rules.cell
        apart = np.linalg.norm(at[:, None] - at, axis=2) + 1e9 * np.eye(len(at))
        same = one.index[:, None] * one.index > 0
        assert (apart >= np.where(same, rules.apart, rules.opposite) * rules.cell).all()


def test_away_from_a_curve_and_only_where_given(waist):
    rules = rules_for(waist, ("free", "free"), most=2)
    curve = waist.vertices[np.abs(waist.vertices[:, 2] - 3.5) < 0.4]
    curve = curve[np.lexsort((np.arctan2(curve[:, 1], curve[:, 0]), curve[:, 2]))]
    found = place(waist, replace(rules, away=((curve, 2.0),))).proposals[-1]
    at = waist.vertices[found.vertex]
    assert distance_to(at, curve).min() >= 2 * rules.cell
    spots = np.append(waist.vertices[[300, 700]], [[rules.cell], [0.01]], axis=1)
    found = place(waist, replace(rules, only=spots)).proposals[-1]
    at = waist.vertices[found.vertex]
    off = np.linalg.norm(at[:, None] - spots[:, :3], axis=2)
    assert (off <= spots[:, 3]).any(axis=1).all()
    assert 700 in found.vertex


def test_distance_to_a_curve():
    rng = np.random.default_rng(3)
    line, points = rng.normal(size=(600, 3)), rng.normal(size=(20, 3))
    t = np.linspace(0, 1, 400)[:, None, None]
    dense = (line[:-1] * (1 - t) + line[1:] * t).reshape(-1, 3)
    near = np.linalg.norm(points[:, None] - dense[None], axis=2).min(axis=1)
    assert (distance_to(points, line) <= near).all()
    assert distance_to(points, line) == pytest.approx(near, abs=1e-3)
    alone = np.linalg.norm(points - line[0], axis=1)
    assert distance_to(points, line[:1]) == pytest.approx(alone)


def test_too_few_for_the_topology():
    surface = shapes.ellipsoid(800)
    with pytest.raises(SingularitiesError, match="takes at least 12"):
        place(surface, rules_for(surface, (), 200, most=12), 5)
    with pytest.raises(SingularitiesError, match="add up"):
        place(surface, rules_for(surface, (), 200, most=5))


def oval():
    """A tube with a waist and two mirror planes."""
    plain = shapes.waist()
    return shapes.surface_of(plain.vertices * [1.5, 1.0, 1.0] + [0, 0, 0.02], plain.faces)


@pytest.fixture(scope="module")
def symmetric():
    surface = oval()
    rules = rules_for(surface, ("free", "free"), most=4, symmetric=True)
    return surface, rules, place(surface, rules)


class TestSymmetric:
    def test_each_number_is_carried_to_itself(self, symmetric):
        surface, rules, placing = symmetric
        groups = symmetries(surface, rules.cell)
        assert {group.name for group in groups} == {"a mirror plane", "two mirror planes", "turns by 1/2"}
        assert placing.symmetry
        assert len(placing.proposals) > 1
        for one in placing.proposals[1:]:
            at = surface.vertices[one.vertex]
            off = [
                max(
                    np.linalg.norm(image[one.index == k][:, None] - at[one.index == k], axis=2)
                    .min(axis=1)
                    .max()
                    for image in group.images(at)
                    for k in set(one.index)
                )
                for group in groups
            ]
            assert min(off) < 0.6 * rules.cell
            assert sum(one.loops) + one.index.sum() == 0

    def test_they_leave_no_less_than_those_that_need_not(self, symmetric):
        surface, rules, placing = symmetric
        free = {one.count: one for one in place(surface, replace(rules, symmetric=False)).proposals}
        for one in placing.proposals:
            assert one.uncovered > 0.8 * free[one.count].uncovered

    def test_a_surface_without_any_is_refused(self):
        plain = oval()
        x, y, z = plain.vertices.T
        surface = shapes.surface_of(np.stack([x * (1.2 + 0.3 * y), y + 0.3 * x, z], axis=1), plain.faces)
        with pytest.raises(SingularitiesError, match="no mirror plane") as caught:
            place(surface, rules_for(surface, ("free", "free"), symmetric=True))
        assert caught.value.field == ("singularities", "symmetric")


def test_rules_that_leave_no_place(waist):
    rules = rules_for(waist, ("free", "free"), away=((waist.vertices[::40], 50.0),))
    with pytest.raises(SingularitiesError, match="leave no place"):
        place(waist, rules)


class TestGiven:
    def listed(self, surface, vertices, indices, ends=("free", "free")):
        at = tuple(SingularityAt(k, vertex=v) for v, k in zip(vertices, indices, strict=True))
        return given(surface, rules_for(surface, ends), at)

    def test_stand_where_they_are_listed(self, waist):
        found = self.listed(waist, [620, 340, 500], [-1, 1, -1])
        assert found.vertex.tolist() == [340, 500, 620]
        assert found.index.tolist() == [1, -1, -1]
        assert sum(found.loops) == 1

    def test_at_points(self, waist):
        at = tuple(SingularityAt(-1, point=tuple(waist.vertices[v] + 0.01)) for v in (620, 700))
        found = given(waist, rules_for(waist, ("free", "free")), at)
        assert found.vertex.tolist() == [620, 700]

    @pytest.mark.parametrize(
        ("vertices", "fault", "number"),
        [
            ([620, 99999], "only vertices", 1),
            ([0, 620], "not inside", 0),
            ([620, 620], "list each place once", 1),
        ],
    )
    def test_refusals(self, waist, vertices, fault, number):
        with pytest.raises(SingularitiesError, match=fault) as caught:
            self.listed(waist, vertices, [-1, 1])
        assert caught.value.field == ("singularities", "at", number, "vertex")

    def test_indices_must_add_up_between_straight_ends(self, waist):
        with pytest.raises(SingularitiesError, match="add up to -1") as caught:
            self.listed(waist, [620], [-1], ("straight", "straight"))
        assert caught.value.data == {"sum": -1, "wanted": 0}

    @pytest.mark.parametrize(
        "asked",
        [{"index": 0, "vertex": 3}, {"index": 1}, {"index": 1, "vertex": 2, "point": (0.0, 0.0, 0.0)}],
    )
    def test_entries_that_say_nothing(self, asked):
        with pytest.raises(SettingError):
            SingularityAt(**asked)


class TestUncovered:
    def test_nothing_where_all_are_alike(self):
        assert uncovered(np.full(50, 0.3), np.full(50, 0.02), 3) == pytest.approx(0.0, abs=1e-12)

    def test_one_size_leaves_what_it_must(self):
        u = np.array([0.0, np.log(2.0)])  # cells twice as wide: three quarters stay open
        assert uncovered(u, np.array([0.5, 0.5]), 1) == pytest.approx(0.375, abs=0.003)
        assert uncovered(u, np.array([0.5, 0.5]), 2) == pytest.approx(0.0, abs=0.003)
        assert uncovered(u, np.array([0.5, 0.5]), None) == 0

    def test_of_many_as_of_one(self):
        rng = np.random.default_rng(2)
        u, weight = rng.normal(0, 0.2, (400, 5)), rng.uniform(0.5, 1, 400)
        weight /= weight.sum()
        one_by_one = [uncovered(column, weight, 7) for column in u.T]
        assert uncovered_of_many(u, weight, 7) == pytest.approx(one_by_one, rel=0.1)

    def test_more_sizes_leave_less(self):
        u, weight = np.linspace(0, 1, 300), np.full(300, 1 / 300)
        left = [uncovered(u, weight, k) for k in (1, 2, 3, 5, 11)]
        assert (np.diff(left) < 0).all()


def test_the_slope_of_a_linear_function():
    """Of height on a straight tube it is 1 everywhere inside."""
    surface = shapes.straight()
    patch = np.arange(len(surface.vertices))
    height = surface.vertices[:, 2]
    steep = Steepness.between(surface, patch, surface.vertices).of(height)
    assert steep[(height > 0.5) & (height < 3.5)] == pytest.approx(1.0, rel=0.15)
    both = Steepness.between(surface, patch, surface.vertices).of(np.stack([height, 2 * height], axis=1))
    assert both[:, 1] == pytest.approx(2 * both[:, 0])
