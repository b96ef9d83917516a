"""Singularities: panels with one side fewer or more, where the surface bulges or pinches.

Count or Points; the server moves each by less than a panel to where the pattern can have it.
"""

# include: wire canvas choices


def singularities(points, indices):
    """The request's own words for points and indices. Raises Refusal."""
    if len(indices) <= 1:
        indices = (indices or [1]) * len(points)
    if len(indices) != len(points):
        raise Refusal(
            "%d points and %d indices: give one index per point, or one for all." % (len(points), len(indices))
        )
    for k, index in enumerate(indices):
        if int(index) == 0:
            raise Refusal("Index %d is 0, which is no singularity: give +1 or -1." % k)
    return [{"point": [p.X, p.Y, p.Z], "index": int(i)} for p, i in zip(points, indices)]


def solve():
    offer(component, {"Count": COUNTS})
    points = [p for p in Points or [] if p is not None]
    if points:
        chosen = {"at": singularities(points, [i for i in Index or [] if i is not None])}
        component.Message = "%d points" % len(points)
    else:
        most = count(Count, "Count")
        if most is None:
            component.Message = "none"
            remark(component, "Nothing is wired: give Count or Points.")
            return (None,)
        chosen = {"count": most}
        component.Message = "auto" if most == "auto" else "at most %d" % most
    return (json_text({"singularities": chosen}),)


component = ghenv.Component
(Singularities,) = solved(component, solve, 1)
