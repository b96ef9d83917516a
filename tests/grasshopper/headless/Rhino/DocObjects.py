"""A document: layers, objects, block definitions, and Undo in steps, as far as Bake uses them."""

import uuid

from Rhino.Geometry import Curve, GeometryBase, Mesh, Transform


class Layer(object):
    def __init__(self):
        self.Name, self.Color, self.ParentLayerId = None, None, None
        self.Id = uuid.uuid4()


class ObjectAttributes(object):
    def __init__(self):
        self.Name, self.LayerIndex, self.texts = None, 0, {}

    def SetUserString(self, key, value):
        assert isinstance(value, type("")) or str is bytes, repr(value)
        self.texts[key] = value
        return True


class ObjectEnumeratorSettings(object):
    NormalObjects, LockedObjects, HiddenObjects = True, True, False


class _Thing(object):
    def __init__(self, geometry, attributes, hidden=False):
        self.geometry, self.attributes, self.hidden = geometry, attributes, hidden


class _Layers(list):
    def path(self, index):
        above = [k for k, layer in enumerate(self) if layer.Id == self[index].ParentLayerId]
        return (self.path(above[0]) + "::" if above else "") + self[index].Name

    def FindByFullPath(self, path, missing):
        return next((k for k in range(len(self)) if self.path(k) == path), missing)

    def Add(self, layer):
        assert layer.Name and "::" not in layer.Name
        self.append(layer)
        return len(self) - 1


class _Blocks(list):
    """Rows: (name, geometry)."""

    class Found(object):
        def __init__(self, index):
            self.Index = index

    def Find(self, name):
        return next((self.Found(k) for k, row in enumerate(self) if row[0] == name), None)

    def Add(self, name, description, base, geometry, attributes):
        assert len(geometry) == len(attributes) and base.xyz() == [0.0, 0.0, 0.0]
        assert all(isinstance(part, GeometryBase) for part in geometry)
        self.append((name, geometry))
        return len(self) - 1

    def ModifyGeometry(self, index, geometry, attributes):
        self[index] = self[index][0], geometry
        return True


class _Objects(object):
    def __init__(self, document):
        self.document = document

    def _add(self, geometry, attributes):
        assert self.document.record, "an object outside of an undo record"
        assert 0 <= attributes.LayerIndex < len(self.document.Layers)
        self.document.things.append(_Thing(geometry, attributes))

    def AddCurve(self, curve, attributes):
        assert isinstance(curve, Curve)
        self._add(curve, attributes)

    def AddMesh(self, mesh, attributes):
        assert isinstance(mesh, Mesh)
        self._add(mesh, attributes)

    def AddInstanceObject(self, index, motion, attributes):
        assert isinstance(motion, Transform) and 0 <= index < len(self.document.InstanceDefinitions)
        self._add((index, motion), attributes)

    def FindByUserString(self, key, value, case, search_geometry, search_attributes, settings):
        assert (case, search_geometry, search_attributes) == (True, False, True)
        return [
            thing
            for thing in self.document.things
            if thing.attributes.texts.get(key) == value and (settings.HiddenObjects or not thing.hidden)
        ]

    def Delete(self, thing, quiet, ignore_modes):
        assert quiet is True and ignore_modes is True and self.document.record
        self.document.things.remove(thing)
        return True


class Document(object):
    def __init__(self):
        self.Layers, self.InstanceDefinitions = _Layers(), _Blocks()
        self.Objects = _Objects(self)
        self.Views, self.ModelUnitSystem = self, "Millimeters"
        self.things, self.history, self.record, self.drawn = [], [], None, 0

    def Redraw(self):
        self.drawn += 1

    def BeginUndoRecord(self, words):
        assert self.record is None
        self.record = words
        self.history.append((words, list(self.things)))
        return len(self.history)

    def EndUndoRecord(self, serial):
        assert serial == len(self.history) and self.record
        self.record = None
        return True

    def undo(self):
        self.things = self.history.pop()[1]
