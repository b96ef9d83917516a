"""What the components use of Grasshopper; calls from the wrong thread or with the wrong types are refused."""

import sys
import types

import Rhino
import rules
import System


class GH_RuntimeMessageLevel(object):
    Error, Warning, Remark = "error", "warning", "remark"


class GH_Document(object):
    escape_is_down = False

    class GH_ScheduleDelegate(System.Action):
        pass

    def __init__(self):
        self.scheduled = []

    @staticmethod
    def IsEscapeKeyDown():
        assert Rhino.on_ui_thread()
        return GH_Document.escape_is_down

    def ScheduleSolution(self, delay, callback):
        assert Rhino.on_ui_thread() and isinstance(delay, int)
        assert isinstance(callback, GH_Document.GH_ScheduleDelegate)
        self.scheduled.append(callback)


class GH_Path(object):
    def __init__(self, *indices):
        for index in indices:
            assert isinstance(index, int)
        self.indices = indices


class GH_ValueListItem(object):
    def __init__(self, name, expression):
        self.Name, self.Expression = name, expression


class _Tree(object):
    """branches: {path: items}"""

    def __init__(self):
        self.branches = {}

    def Add(self, item, path):
        assert isinstance(path, GH_Path)
        self.branches.setdefault(path.indices, []).append(rules.as_object(item))

    def flat(self):
        return [item for path in sorted(self.branches) for item in self.branches[path]]


class _DataTree(object):
    def __getitem__(self, kind):
        assert kind is System.Object
        return _Tree


DataTree = _DataTree()

Kernel = types.ModuleType("Grasshopper.Kernel")
Kernel.GH_RuntimeMessageLevel = GH_RuntimeMessageLevel
Kernel.GH_Document = GH_Document
Kernel.Data = types.ModuleType("Grasshopper.Kernel.Data")
Kernel.Data.GH_Path = GH_Path
Kernel.Special = types.ModuleType("Grasshopper.Kernel.Special")
Kernel.Special.GH_ValueListItem = GH_ValueListItem
sys.modules["Grasshopper.Kernel"] = Kernel
