"""Puts the panels of a job into the Rhino document, as an architect would by hand.

A layer per size, the label as name, the figures as user text; blocks, one per size, where the job has components.
Every object remembers which component baked it: the next bake replaces them all, and one Undo takes it back.
"""

# include: wire canvas meshes

OWNER = "hexwrap.bake"  # user text that names the component which made an object
PARTS = ["panels", "pattern", "sizes", "components"]
NO_SIZE = "#b0b0b0"
SAME = 1e-6  # of an edge: how far corners of panels of one block may differ


class Piece(object):
    """What is to lie in the document for one panel. place: (origin, x, y, z) of its own plane."""

    def __init__(self, size, texts, outline, solid, place):
        self.size, self.texts, self.outline, self.solid, self.place = size, texts, outline, solid, place


def gather(token, url):
    """Work of the background thread: the pieces, and the layers' names and colours by size."""
    result = finished(url, token, PARTS)
    if not result.get("panels"):
        raise Refusal("This job has no panels: it was sent without a pattern or without panels.")
    panels, pattern, sizes = result["panels"], result["pattern"], result["sizes"]
    built = result.get("components")
    token.say("%d panels" % len(panels["polygons"]))
    label_of = dict(zip(panels["face"], panels["label"]))
    pieces = []
    for k, size in enumerate(panels["size"]):
        texts = describe(panels, pattern, label_of, k)
        if built is None:
            pieces.append(Piece(size, texts, panels["polygons"][k], None, None))
            continue
        solid = None
        if built.get("solid_vertices"):
            solid = built["solid_vertices"][k], built["solid_faces"][k]
        place = [built[name][k] for name in ("origin", "x_axis", "y_axis", "z_axis")]
        pieces.append(Piece(size, texts, built["outline"][k], solid, place))
    layers = dict((row["size"], (size_name(row), row["color"])) for row in sizes)
    layers[-1] = ("no size", NO_SIZE)
    return pieces, layers


def size_name(row):
    name = "size-%02d (%.4g)" % (row["size"], row["edge_length"])
    return name if row.get("sides", 6) == 6 else "%s, %d sides" % (name, row["sides"])


def describe(panels, pattern, label_of, k):
    """User text of a panel, in the order in which Rhino should list it."""
    cell = panels["face"][k]
    texts = [("label", panels["label"][k]), ("size", "%d" % panels["size"][k])]
    texts.append(("edge_length", "%.9g" % panels["edge_length"][k]))
    for key in ("ring", "place"):
        if pattern.get(key):
            texts.append((key, "%d" % pattern[key][cell]))
    for key in ("planarity", "surface_distance", "gap_tangential"):
        if panels.get(key) and panels[key][k] is not None:
            texts.append((key, "%.4g" % panels[key][k]))
    across = [label_of.get(other, "-") for other in pattern["neighbours"][cell]]
    return texts + [("neighbours", " ".join(across))]


# --- into the document: on the user interface's thread -----------------------------------------------------


class Baker(object):
    """One bake into the open document."""

    def __init__(self, owner, top, layers):
        self.document = Rhino.RhinoDoc.ActiveDoc
        self.owner, self.top, self.layers = owner, top, layers
        self.blocks, self.indices, self.count = {}, {}, 0

    def replace(self, pieces):
        """Everything in one step for Undo. Returns the number of objects."""
        record = self.document.BeginUndoRecord("hexwrap Bake")
        try:
            self.remove()
            for piece in pieces:
                self.add(piece)
        finally:
            self.document.EndUndoRecord(record)
        self.document.Views.Redraw()
        return self.count

    def remove(self):
        """What this component baked before, on locked and hidden layers, too."""
        every = Rhino.DocObjects.ObjectEnumeratorSettings()
        every.NormalObjects = every.LockedObjects = every.HiddenObjects = True
        for thing in self.document.Objects.FindByUserString(OWNER, self.owner, True, False, True, every) or []:
            self.document.Objects.Delete(thing, True, True)

    def layer(self, size):
        """Index of a size's layer, made with all layers above it where it is not there."""
        if size not in self.indices:
            name, shade = self.layers[size]
            index, path = -1, ""
            for part in self.top.split("::") + [name]:
                path = path + "::" + part if path else part
                index = self.find_or_make(path, part, index, shade)
            self.indices[size] = index
        return self.indices[size]

    def find_or_make(self, path, name, above, shade):
        found = self.document.Layers.FindByFullPath(path, -1)
        if found >= 0:
            return found
        layer = Rhino.DocObjects.Layer()
        layer.Name = name
        layer.Color = colour(shade)
        if above >= 0:
            layer.ParentLayerId = self.document.Layers[above].Id
        return self.document.Layers.Add(layer)

    def attributes(self, piece):
        made = Rhino.DocObjects.ObjectAttributes()
        made.Name = piece.texts[0][1]
        made.LayerIndex = self.layer(piece.size)
        made.SetUserString(OWNER, self.owner)
        for key, value in piece.texts:
            made.SetUserString(key, value)
        return made

    def add(self, piece):
        objects, attributes = self.document.Objects, self.attributes(piece)
        block = None if piece.place is None or piece.size < 0 else self.block(piece)
        if block is not None:
            objects.AddInstanceObject(block, onto(piece.place), attributes)
            self.count += 1
            return
        objects.AddCurve(closed_polyline(piece.outline), attributes)
        self.count += 1
        if piece.solid is not None:
            objects.AddMesh(triangles(*piece.solid), attributes)
            self.count += 1

    def block(self, piece):
        """Index of the size's block, made from its first panel; None for a panel that is not like that one."""
        local = within(piece.place, piece.outline)
        if piece.size not in self.blocks:
            solid = piece.solid and (within(piece.place, piece.solid[0]), piece.solid[1])
            self.blocks[piece.size] = self.define(piece.size, local, solid), local
        index, shape = self.blocks[piece.size]
        edge = max(abs(c) for p in shape for c in p)
        alike = len(shape) == len(local) and all(
            abs(a - b) <= SAME * edge for p, q in zip(shape, local) for a, b in zip(p, q)
        )
        return index if alike else None

    def define(self, size, outline, solid):
        # The owner's number keeps two Bake components from changing each other's blocks.
        name = "%s::%s [%s]" % (self.top, self.layers[size][0], self.owner[:8])
        parts = [closed_polyline(outline)] + ([triangles(*solid)] if solid else [])
        geometry = System.Array[Rhino.Geometry.GeometryBase](parts)
        attributes = System.Array[Rhino.DocObjects.ObjectAttributes]([self.part(size) for _ in parts])
        table = self.document.InstanceDefinitions
        known = table.Find(name)
        if known is None:
            origin = point([0.0, 0.0, 0.0])
            return table.Add(name, "A panel of hexwrap, in its own plane", origin, geometry, attributes)
        table.ModifyGeometry(known.Index, geometry, attributes)
        return known.Index

    def part(self, size):
        made = Rhino.DocObjects.ObjectAttributes()
        made.LayerIndex = self.layer(size)
        return made


def within(place, points):
    """Points in the coordinates of a plane (origin, x, y, z)."""
    origin, axes = place[0], place[1:]
    return [[sum((p[i] - origin[i]) * a[i] for i in range(3)) for a in axes] for p in points]


def onto(place):
    """The motion that takes the world's axes to a plane (origin, x, y, z)."""
    motion = Rhino.Geometry.Transform(1.0)
    for row in range(3):
        for column in range(3):
            motion[row, column] = float(place[1 + column][row])
        motion[row, 3] = float(place[0][row])
    return motion


def solve():
    slot = slot_of(component)
    if not Job:
        stop(slot)
        component.Message = "no job yet"
    elif Bake:
        top = TEXT(Layer).strip() if Layer and TEXT(Layer).strip() else "hexwrap"
        owner = "%s/%d" % (component.InstanceGuid, component.RunCount)

        def finish(found):
            count = Baker(owner, top, found[1]).replace(found[0])
            return {"count": count, "status": "%d panels, %d objects on layer %s" % (len(found[0]), count, top)}

        in_background(
            component, slot, (TEXT(Job), top), lambda token, url=TEXT(Job): gather(token, url), finish
        )
        state_message(component, slot, "baked")
    else:
        if not slot["busy"]:
            slot["wanted"] = None  # so that the next press bakes again; one that is under way is finished
        state_message(component, slot, "baked" if slot["result"] else "press Bake")
    last = slot["result"] or {}
    return last.get("count"), last.get("status") or component.Message


component = ghenv.Component
Count, Status = solved(component, solve, 2)
