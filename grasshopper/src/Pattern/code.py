"""Settings of the pattern: its kind, its size, and how it sits on the surface."""

# include: wire canvas choices

KINDS = [
    "hex",
    "triangle",
    "quad",
    "diamond",
    "brick",
    "trihexagonal",
    "truncated-hexagonal",
    "truncated-square",
    "rhombitrihexagonal",
]
ALIGN = ["none", "first", "both"]
EDGES = ["whole", "trim"]
TURNS = ["edge", "vertex", "u", "v"]


def rotation(value):
    """A word, or a number of degrees."""
    if value is None or not TEXT(value).strip():
        return None
    word = TEXT(value).strip().strip('"').lower()
    return word if word in TURNS else number(word, "Rotation (edge, vertex, u, v, or degrees)")


def size():
    """(around, edge length), at most one of them. Raises Refusal."""
    around = int(Around) if Around else None
    length = float(EdgeLength) if EdgeLength else None
    if around and length:
        raise Refusal("Give either Around or EdgeLength: each of them sets the size of the cells.")
    if (around or 1) < 1 or (length or 1.0) <= 0.0:
        raise Refusal("Around and EdgeLength must be positive.")
    return around, length


def pattern_settings():
    around, length = size()
    return settings(
        {
            "kind": choice(Kind, KINDS, "Kind"),
            "around": around,
            "edge_length": length,
            "rotation": rotation(Rotation),
            "align": choice(Align, ALIGN, "Align"),
            "boundary": choice(Boundary, EDGES, "Boundary"),
            "phase": [float(PhaseX or 0.0), float(PhaseY or 0.0)] if PhaseX or PhaseY else None,
        }
    )


def solve():
    words = {"Kind": KINDS, "Align": ALIGN, "Boundary": EDGES, "Rotation": TURNS[:2], "Singularities": COUNTS}
    offer(component, words)
    chosen = {"pattern": pattern_settings()}
    component.Message = chosen["pattern"].get("kind", "hex")
    most = count(Singularities, "Singularities")
    if most is not None:
        chosen["singularities"] = {"count": most}
    return (json_text(chosen),)


component = ghenv.Component
(Pattern,) = solved(component, solve, 1)
