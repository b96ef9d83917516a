# --- Rhino's geometry, to the server and back ------------------------------------------------------------
# Numbers are written by repr alone: the decimal comma of a locale never gets into them.


UNITS = {"Meters": "m", "Centimeters": "cm", "Millimeters": "mm", "Feet": "ft", "Inches": "in"}


def model_unit():
    """The open document's unit as the server writes it; None where there is no document or no such unit."""
    document = Rhino.RhinoDoc.ActiveDoc
    return UNITS.get(str(getattr(document, "ModelUnitSystem", None)).split(".")[-1])


def as_mesh(geometry):
    """(mesh, normals or None) of a Mesh, Brep, Surface, Extrusion or SubD. Raises Refusal."""
    if isinstance(geometry, Rhino.Geometry.Mesh):
        return geometry, None
    brep = geometry if isinstance(geometry, Rhino.Geometry.Brep) else None
    if brep is None and hasattr(geometry, "ToBrep"):
        brep = geometry.ToBrep()
    if brep is None:
        raise not_a_surface(geometry)
    settings = Rhino.Geometry.MeshingParameters()
    settings.GridMinCount = 2000  # a straight cylinder would otherwise become a single row of quads
    settings.GridAspectRatio = 1.0
    settings.JaggedSeams = False
    joined = Rhino.Geometry.Mesh()
    for part in Rhino.Geometry.Mesh.CreateFromBrep(brep, settings) or []:
        joined.Append(part)
    if joined.Faces.Count == 0:
        raise Refusal("Rhino could not mesh this surface. Repair it, or mesh it yourself and wire the mesh.")
    return joined, joined.Normals if joined.Normals.Count == joined.Vertices.Count else None


def not_a_surface(geometry):
    return Refusal("Mesh must be a mesh or a surface, not %s." % type(geometry).__name__)


def mesh_arrays(mesh):
    """Points and faces exactly as Rhino holds them: quads, unwelded seams and all."""
    points = [(p.X, p.Y, p.Z) for p in mesh.Vertices.ToPoint3dArray()]
    faces = []
    for i in range(mesh.Faces.Count):
        face = mesh.Faces[i]
        if face.IsQuad:
            faces.append((face.A, face.B, face.C, face.D))
        else:
            faces.append((face.A, face.B, face.C))
    return points, faces


def surface_json(points, faces, normals):
    """Body of POST /v1/surfaces as bytes."""
    parts = ['{"vertices":[', ",".join(["[%r,%r,%r]" % p for p in points]), '],"faces":[']
    parts.append(",".join(["[%s]" % ",".join([str(v) for v in face]) for face in faces]))
    if normals is not None:
        parts.append('],"normals":[')
        parts.append(",".join(["[%r,%r,%r]" % (float(n.X), float(n.Y), float(n.Z)) for n in normals]))
    parts.append("]}")
    return "".join(parts).encode("ascii")


def point(xyz):
    return Rhino.Geometry.Point3d(float(xyz[0]), float(xyz[1]), float(xyz[2]) if len(xyz) > 2 else 0.0)


def vector(xyz):
    return Rhino.Geometry.Vector3d(float(xyz[0]), float(xyz[1]), float(xyz[2]))


def polyline(points):
    """A curve through points that are [x, y] or [x, y, z]."""
    corners = System.Array[Rhino.Geometry.Point3d]([point(p) for p in points])
    return Rhino.Geometry.PolylineCurve(corners)


def closed_polyline(points):
    return polyline(list(points) + [points[0]])


def joined(polygons):
    """One mesh of flat polygons, each a fan around its own centre: what shades in one colour."""
    mesh = Rhino.Geometry.Mesh()
    start = 0
    for points in polygons:
        n = len(points)
        centre = [sum(p[i] for p in points) / float(n) for i in range(3)]
        for p in [centre] + list(points):
            mesh.Vertices.Add(float(p[0]), float(p[1]), float(p[2]))
        for k in range(n):
            mesh.Faces.AddFace(start, start + 1 + k, start + 1 + (k + 1) % n)
        start += n + 1
    mesh.Normals.ComputeNormals()
    return mesh


def triangles(points, corners):
    """A mesh from points and corner numbers, three to a triangle, in one row."""
    mesh = Rhino.Geometry.Mesh()
    for p in points:
        mesh.Vertices.Add(float(p[0]), float(p[1]), float(p[2]))
    for k in range(0, len(corners), 3):
        mesh.Faces.AddFace(corners[k], corners[k + 1], corners[k + 2])
    mesh.Normals.ComputeNormals()
    return mesh


def colour(text):
    """#rrggbb"""
    return System.Drawing.Color.FromArgb(int(text[1:3], 16), int(text[3:5], 16), int(text[5:7], 16))


def faulty_geometry(problem, points, faces):
    """(points, lines) of the vertices, faces and edges that a problem names, on the mesh as it was sent."""
    named = list(problem.get("vertices") or [])
    for face in problem.get("faces") or []:
        named.extend(faces[face])
    ends = problem.get("edges") or []
    lines = [Rhino.Geometry.Line(point(points[a]), point(points[b])) for a, b in ends]
    return [point(points[v]) for v in sorted(set(named))], lines
