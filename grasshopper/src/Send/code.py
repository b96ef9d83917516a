"""Sends a mesh or surface and the settings to the hexwrap server and waits in the background.

Job is the address of the last finished job; it changes once a new one is done. Errors come with the points
and edges of the mesh that are at fault.
"""

# include: wire canvas choices meshes


STEPS = 100  # pieces of a curve that is no polyline
MODES = ["auto", "straight", "angles", "isometric", "isometric optimal"]


def part_of_request(text, name):
    """What Boundary Angles, Pattern, Panels or Singularities put out. Raises Refusal."""
    try:
        part = json.loads(text)
    except (ValueError, TypeError):
        part = None
    if not isinstance(part, dict) or name not in part:
        raise Refusal("The input for %s takes the output of the component of that name." % name)
    return part


def feature_lines(curves):
    """Points along each curve; the corners of a polyline stay corners."""
    lines = []
    for curve in curves or []:
        if curve is None:
            continue
        found, drawn = curve.TryGetPolyline()
        points = list(drawn) if found else [curve.PointAt(t) for t in curve.DivideByCount(STEPS, True)]
        if not found and curve.IsClosed:
            points.append(points[0])
        lines.append([[p.X, p.Y, p.Z] for p in points])
    return lines


def request_body(mode, parts, name, lines=()):
    """The request but for the geometry. parts: (text, key of the request). lines: features. Raises Refusal."""
    unit = model_unit()
    body = {"name": TEXT(name) if name else "grasshopper", "surface": {"unit": unit} if unit else {}}
    for text, key in parts:
        if text:
            body.update(part_of_request(text, key))
    if lines:
        body["surface"]["features"] = {"lines": lines}
    mode = choice(mode, MODES, "Mode")
    if mode == "angles" and "boundary" not in body:
        raise Refusal("Mode is angles, but no angles came: wire the component Boundary Angles to Angles.")
    if mode and mode != "angles":
        body["boundary"] = {"mode": mode.split()[0]}
        if mode.endswith("optimal"):
            body["boundary"]["spread"] = "optimal"
    return body


def surface_id(token, slot, server, key, geometry):
    """Sends the mesh unless this server has it already."""
    known = slot.get("surface")
    if known and known["key"] == (server, key):
        return known["id"]
    # First something small: a server that refuses a large body unread may close before its reason is heard.
    call_json(server, "GET", "/v1/jobs?limit=1")
    token.say("reading the mesh")
    mesh, normals = as_mesh(geometry)
    points, faces = mesh_arrays(mesh)
    body = surface_json(points, faces, normals)
    token.check()
    token.say("sending %d vertices" % len(points))
    slot["sent"] = (points, faces)
    try:
        answer = json.loads(call(server, "POST", "/v1/surfaces", body, timeout=SLOW).decode("utf-8"))
    except Offline:
        raise Refusal(
            "The server at %s broke off while the mesh was sent (%d MiB). If it still runs, start it with a larger "
            "--max-body-mib, or send a coarser mesh." % (server, len(body) // 1048576 + 1)
        )
    slot["surface"] = {"key": (server, key), "id": answer["id"]}
    slot["repairs"] = answer.get("repairs") or []
    return answer["id"]


def post(token, slot, server, key, geometry, body):
    """Name of the job. A server that forgot the mesh gets it once more."""
    request = dict(body)
    request["surface"] = dict(body["surface"], id=surface_id(token, slot, server, key, geometry))
    try:
        return call_json(server, "POST", "/v1/jobs", request, timeout=SLOW)["id"]
    except Refusal as refused:
        if not any(fault.get("pointer") == "/surface/id" for fault in refused.problem.get("errors") or []):
            raise
    slot["surface"] = None
    request["surface"] = dict(body["surface"], id=surface_id(token, slot, server, key, geometry))
    return call_json(server, "POST", "/v1/jobs", request, timeout=SLOW)["id"]


def send(token, slot, server, key, geometry, body, limit):
    """Work of the background thread: the address and the summary of the finished job."""
    give_up_at = time.time() + limit if limit else None
    for _ in range(3):
        token.check()
        name = post(token, slot, server, key, geometry, body)
        try:
            job = wait_for_job(server, name, token, give_up_at)
        except Superseded:
            forget_job(server, name)
            raise
        except Refusal as refused:
            if refused.problem.get("status") != 404:
                raise
            job = {"status": "cancelled"}
        if job["status"] != "cancelled":
            break
        # An older request of ours for the same work was withdrawn at this moment and took this one along,
        # or the server was started anew and has forgotten it.
    if job["status"] == "failed":
        problem = job.get("problem") or {}
        raise Refusal(problem.get("detail") or "The job failed without saying why.", problem)
    if job["status"] == "cancelled":
        raise Refusal("Somebody else cancelled the job on the server. Toggle Run to start it again.")
    return {"job": "%s/v1/jobs/%s" % (server, name), "status": summary(job, slot)}


def summary(job, slot):
    timings = job.get("timings") or {}
    lines = ["done in %.2f s" % sum(timings.values())]
    lines += ["  %s %.2f s" % (stage, timings[stage]) for stage in timings]
    return "\n".join(lines + ["repair: " + text for text in slot.get("repairs") or []])


def request(slot):
    if not hasattr(Mesh, "DataCRC"):  # a circle, a line, a box: structures, not geometry with a checksum
        raise not_a_surface(Mesh)
    server = "http://%s:%d" % (TEXT(IP).strip() if IP else "127.0.0.1", int(Port or 6789))
    TOKENS[server] = TEXT(Token) if Token else None
    parts = ((Angles, "boundary"), (Pattern, "pattern"), (Panels, "panels"), (Singularities, "singularities"))
    body = request_body(Mode, parts, Name, feature_lines(Features))
    key = "%s %d" % (type(Mesh).__name__, Mesh.DataCRC(0))
    wanted = (server, key, json_text(body))
    if slot["wanted"] != wanted:
        geometry = Mesh.Duplicate()  # the background thread reads a copy that nobody else changes
        limit = float(TimeOut or 0)
        work = lambda token: send(token, slot, server, key, geometry, body, limit)
        in_background(component, slot, wanted, work)


def solve():
    slot = slot_of(component)
    listen_for_escape(slot, component)
    offer(component, {"Mode": MODES})
    faults, fault_edges = [], []
    if not Run:
        stop(slot)
        component.Message = "Run is off"
    elif Mesh is None:
        stop(slot)
        component.Message = "no mesh"
        warning(component, "Mesh is empty: wire a mesh or a surface.")
    else:
        try:
            request(slot)
        except Exception as fault:
            stop(slot)
            slot["error"] = as_refusal(fault)
        if slot["error"] is not None and slot.get("sent"):
            faults, fault_edges = faulty_geometry(slot["error"].problem, *slot["sent"])
        state_message(component, slot, "done")
    last = slot["result"] or {}
    return last.get("job"), last.get("status") or component.Message, faults, fault_edges


component = ghenv.Component
Job, Status, Faults, FaultEdges = solved(component, solve, 4)
