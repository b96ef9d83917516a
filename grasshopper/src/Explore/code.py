"""Tries many choices for the surface of a job and puts out the requests that keep the limits, the best first.

Each Request says boundary, pattern, panels and singularities at once: wire one to the input Pattern of another
Send. What was measured stands beside it.
"""

# include: wire canvas choices


def whole(value, name):
    """A positive number, or None. Raises Refusal."""
    if value is None:
        return None
    if int(value) < 1:
        raise Refusal("%s must be 1 or more." % name)
    return int(value)


def limits():
    if MaxGap is not None and float(MaxGap) < 0.0:
        raise Refusal("MaxGap must not be negative.")
    return settings(
        {
            "sizes": whole(MaxSizes, "MaxSizes"),
            "max_gap": None if MaxGap is None else float(MaxGap),
            "panels": whole(MaxPanels, "MaxPanels"),
        }
    )


def body():
    wanted = {"limits": limits(), "variants": whole(Variants, "Variants") or 200, "seed": int(Seed or 0)}
    if MaxSizes is not None:
        wanted["vary"] = {"sizes": [1, int(MaxSizes)]}
    return wanted


def explore(token, url, wanted):
    """Work of the background thread: the front, best first."""
    server, name = split_job(url)
    asked = call_json(server, "GET", "/v1/jobs/%s/request" % name)
    sent = dict(wanted)
    sent["name"] = asked.get("name") or "grasshopper"
    sent["surface"] = asked["surface"]
    ours = call_json(server, "POST", "/v1/explore", sent, timeout=SLOW)["id"]
    try:
        job = wait_for_job(server, ours, token)
    except Superseded:
        forget_job(server, ours)
        raise
    if job["status"] == "failed":
        problem = job.get("problem") or {}
        raise Refusal(problem.get("detail") or "The exploration failed without saying why.", problem)
    if job["status"] == "cancelled":
        raise Refusal("Somebody else cancelled the exploration on the server. Toggle Run to start it again.")
    token.say("collecting")
    return front(call_json(server, "GET", "/v1/jobs/%s/result" % ours, timeout=SLOW))


def front(result):
    """Requests and figures of the front, the proposed one first, then by what is left uncovered."""
    best = result["best"]
    order = sorted(result["front"], key=lambda i: result["variants"][i]["measured"]["uncovered"])
    if best is not None:
        order = [best] + [i for i in order if i != best]
    chosen = [result["variants"][i] for i in order]
    parts = ("boundary", "pattern", "panels", "singularities")
    measured = [one["measured"] for one in chosen]
    return {
        "requests": [json_text(dict((key, one["request"][key]) for key in parts)) for one in chosen],
        "uncovered": [m["uncovered"] for m in measured],
        "types": [m["types"] for m in measured],
        "panels": [m["panels"] for m in measured],
        "gap": [m["gap_max"] for m in measured],
        "cost": [m["cost"] for m in measured],
        "notes": result["notes"],
    }


def solve():
    slot = slot_of(component)
    listen_for_escape(slot, component)
    if not Run or not Job:
        stop(slot)
        component.Message = "no job yet" if Run else "Run is off"
    else:
        wanted, url = body(), TEXT(Job)
        in_background(component, slot, (url, json_text(wanted)), lambda token: explore(token, url, wanted))
        state_message(component, slot, "explored")
    found = slot["result"] or {}
    return [found.get(key) for key in ("requests", "uncovered", "types", "panels", "gap", "cost", "notes")]


component = ghenv.Component
Requests, Uncovered, Types, PanelCount, Gap, Cost, Notes = solved(component, solve, 7)
