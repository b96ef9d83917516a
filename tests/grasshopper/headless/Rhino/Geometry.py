"""Points, meshes and curves with the members that the components use, as RhinoCommon names them."""

import math
import zlib


def _floats(values):
    for value in values:
        assert isinstance(value, float), "%r is no double" % (value,)


class Point3d(object):
    def __init__(self, x, y, z):
        _floats((x, y, z))
        self.X, self.Y, self.Z = x, y, z

    def DistanceTo(self, other):
        return math.sqrt((self.X - other.X) ** 2 + (self.Y - other.Y) ** 2 + (self.Z - other.Z) ** 2)

    def xyz(self):
        return [self.X, self.Y, self.Z]


class Vector3d(Point3d):
    pass


class Plane(object):
    def __init__(self, origin, x_axis, y_axis):
        assert type(origin) is Point3d and type(x_axis) is Vector3d and type(y_axis) is Vector3d
        self.Origin, self.XAxis, self.YAxis = origin, x_axis, y_axis


class Line(object):
    def __init__(self, start, end):
        assert isinstance(start, Point3d) and isinstance(end, Point3d)
        self.From, self.To = start, end

    def ToNurbsCurve(self):
        return PolylineCurve((self.From, self.To))


class MeshFace(object):
    def __init__(self, corners):
        self.A, self.B, self.C = corners[:3]
        self.D = corners[-1]
        self.IsQuad = len(corners) == 4


class _Vertices(object):
    def __init__(self, points):
        self.points = points

    def Add(self, x, y, z):
        _floats((x, y, z))
        self.points.append((x, y, z))

    @property
    def Count(self):
        return len(self.points)

    def ToPoint3dArray(self):
        return [Point3d(*p) for p in self.points]

    def CombineIdentical(self, ignore_normals, ignore_additional):
        first, kept = {}, []
        self.new = []
        for p in self.points:
            key = tuple(round(c, 9) for c in p)
            if key not in first:
                first[key] = len(kept)
                kept.append(p)
            self.new.append(first[key])
        self.points = kept
        return True


class _Faces(object):
    def __init__(self, rows):
        self.rows = rows

    @property
    def Count(self):
        return len(self.rows)

    def __getitem__(self, i):
        return MeshFace(self.rows[i])

    def AddFace(self, *corners):
        assert 3 <= len(corners) <= 4
        self.rows.append(corners)


class _Normals(list):
    def ComputeNormals(self):
        return True

    @property
    def Count(self):
        return len(self)


class GeometryBase(object):
    pass


class Mesh(GeometryBase):
    def __init__(self, points=(), faces=(), normals=()):
        self.Vertices = _Vertices([tuple(float(c) for c in p) for p in points])
        self.Faces = _Faces([tuple(f) for f in faces])
        self.Normals = _Normals(Vector3d(*n) for n in normals)

    def DataCRC(self, start):
        return zlib.crc32(repr((self.Vertices.points, self.Faces.rows)).encode("ascii")) & 0xFFFFFFFF

    def Duplicate(self):
        return self.DuplicateMesh()

    def DuplicateMesh(self):
        return Mesh(self.Vertices.points, self.Faces.rows, [n.xyz() for n in self.Normals])

    def Append(self, other):
        start = self.Vertices.Count
        self.Vertices.points += other.Vertices.points
        self.Faces.rows += [tuple(v + start for v in row) for row in other.Faces.rows]
        self.Normals += other.Normals

    def GetNakedEdges(self):
        """Closed polylines along edges of one face only, after CombineIdentical has moved the faces along."""
        new = getattr(self.Vertices, "new", range(self.Vertices.Count))
        rows = [[new[v] for v in row] for row in self.Faces.rows]
        count = {}
        for row in rows:
            for k in range(len(row)):
                edge = frozenset((row[k - 1], row[k]))
                count[edge] = count.get(edge, 0) + 1
        following = {}
        for row in rows:
            for k in range(len(row)):
                if count[frozenset((row[k - 1], row[k]))] == 1:
                    following[row[k - 1]] = row[k]
        loops = []
        while following:
            start = min(following)
            loop = [start]
            while loop[-1] in following:
                loop.append(following.pop(loop[-1]))
            loops.append([Point3d(*self.Vertices.points[v]) for v in loop])
        return loops

    @staticmethod
    def CreateFromBrep(brep, settings):
        assert isinstance(settings, MeshingParameters)
        return [part.DuplicateMesh() for part in brep.parts]


class MeshingParameters(object):
    pass


class _Meshed(GeometryBase):
    def meshed(self):
        whole = Mesh()
        for part in self.parts:
            whole.Append(part)
        return whole


class Brep(_Meshed):
    """parts: what Rhino would mesh its faces to."""

    def __init__(self, parts):
        self.parts = parts

    def DataCRC(self, start):
        return sum(part.DataCRC(start) for part in self.parts) & 0xFFFFFFFF

    def Duplicate(self):
        return Brep(self.parts)


class Surface(_Meshed):
    def __init__(self, parts):
        self.parts = parts

    def DataCRC(self, start):
        return Brep(self.parts).DataCRC(start)

    def Duplicate(self):
        return Surface(self.parts)

    def ToBrep(self):
        return Brep(self.parts)


class Curve(GeometryBase):
    pass


class Circle(object):
    """A structure, as a wire of circles carries it: no geometry, no curve."""

    def __init__(self, x, y, radius):
        self.x, self.y, self.radius = x, y, radius

    def ToNurbsCurve(self):
        return CircleCurve(self.x, self.y, self.radius)


class Point(GeometryBase):
    def __init__(self, location):
        self.Location = location


class Transform(object):
    def __init__(self, diagonal):
        self.entries = dict(((i, j), diagonal * (i == j)) for i in range(4) for j in range(4))

    def __setitem__(self, place, value):
        _floats((value,))
        assert place in self.entries
        self.entries[place] = value

    def moved(self, p):
        """A point [x, y, z] after the motion."""
        e = self.entries
        return [sum(e[i, j] * p[j] for j in range(3)) + e[i, 3] for i in range(3)]


class PolylineCurve(Curve):
    def __init__(self, points):
        assert isinstance(points, tuple), "a typed array is needed"
        self.points = points

    @property
    def IsClosed(self):
        return self.points[0].DistanceTo(self.points[-1]) < 1e-12

    def TryGetPolyline(self):
        return True, self.points

    def xyz(self):
        return [p.xyz() for p in self.points]


class CircleCurve(Curve):
    """A closed curve that is no polyline."""

    IsClosed = True

    def __init__(self, x, y, radius):
        self.x, self.y, self.radius = x, y, radius

    def TryGetPolyline(self):
        return False, None

    def DivideByCount(self, count, include_ends):
        return [2.0 * math.pi * k / count for k in range(count)]

    def PointAt(self, t):
        return Point3d(self.x + self.radius * math.cos(t), self.y + self.radius * math.sin(t), 0.0)
