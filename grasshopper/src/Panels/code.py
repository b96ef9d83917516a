"""Settings of the panels: how many sizes, how large they may be, how they lie, and what is built on them."""

# include: wire canvas choices

MODES = ["split", "watertight"]
TARGETS = ["shortest", "inscribed", "best", "mean"]
LIES = ["fit", "tangent"]
METHODS = ["exact", "energy"]


def edge_range():
    if not EdgeMin and not EdgeMax:
        return None
    low, high = float(EdgeMin or 0.0), float(EdgeMax or 0.0)
    if not EdgeMax or low > high:
        raise Refusal("EdgeMin and EdgeMax belong together, and EdgeMin must be the smaller one.")
    return [low, high]


def not_negative(value, name):
    if value is not None and float(value) < 0.0:
        raise Refusal("%s must not be negative." % name)
    return None if value is None else float(value)


def components():
    built = settings(
        {
            "inset": not_negative(Inset, "Inset"),
            "thickness": not_negative(Thickness, "Thickness"),
            "depth": not_negative(BeamDepth, "BeamDepth"),
        }
    )
    return built or None


def panel_settings():
    chosen = settings(
        {
            "mode": choice(Mode, MODES, "Mode"),
            "edge_range": edge_range(),
            "target": choice(Target, TARGETS, "Target"),
            "orientation": choice(Orientation, LIES, "Orientation"),
            "joint": not_negative(Joint, "Joint"),
            "increment": not_negative(Increment, "Increment"),
            "method": choice(Method, METHODS, "Method"),
            "max_gap": not_negative(MaxGap, "MaxGap"),
            "components": components(),
        }
    )
    if Sizes is not None:
        if int(Sizes) < 0:
            raise Refusal("Sizes must be 1 or more, or 0 for one size per panel.")
        chosen["sizes"] = int(Sizes) or None
    elif MaxGap is not None:
        chosen["sizes"] = "fewest"
    return chosen


def solve():
    offer(component, {"Mode": MODES, "Target": TARGETS, "Orientation": LIES, "Method": METHODS})
    chosen = panel_settings()
    component.Message = chosen.get("mode", "split")
    return (json_text({"panels": chosen, "support": bool(BeamDepth)}),)


component = ghenv.Component
(Panels,) = solved(component, solve, 1)
