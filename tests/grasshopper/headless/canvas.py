"""A canvas without a screen: solves components as Grasshopper does, on one thread, and counts.

Runs under CPython 3 and Jython 2.7.
"""

from __future__ import print_function

import io
import json
import os
import threading
import time
import uuid

import Grasshopper
import Rhino
import rules

try:
    import urllib2 as url_library
    from Queue import Empty
except ImportError:
    import urllib.request as url_library
    from queue import Empty

FREEZE = 2.0  # seconds of processor time; a job that keeps the canvas from moving takes longer
PATIENCE = 300.0  # seconds; only a test that fails waits as long
BUILT = os.environ["HEXWRAP_BUILT"]  # folder with Name.py and Name.json, unpacked from the built files

CANVAS = threading.current_thread()
asked_on_canvas = []


def own_time():
    """Seconds of processor time of this thread, whatever else the machine does."""
    if hasattr(time, "thread_time"):
        return time.thread_time()
    from java.lang.management import ManagementFactory

    return ManagementFactory.getThreadMXBean().getCurrentThreadCpuTime() / 1e9


def watched(opened):
    """Waiting for a server takes no processor time, but holds the canvas all the same."""

    def run(*arguments, **options):
        if threading.current_thread() is CANVAS:
            asked_on_canvas.append(arguments[1].get_full_url())
        return opened(*arguments, **options)

    return run


url_library.OpenerDirector.open = watched(url_library.OpenerDirector.open)


def execute(code, scope):  # Python 2 allows exec only in functions without inner ones
    exec(code, scope)


class Parameter(object):
    def __init__(self, name):
        self.Name = name
        self.wired = []

    @property
    def Sources(self):
        return [rules.behind_interface(source) for source in self.wired]


class Parameters(object):
    def __init__(self, names):
        self.Input = [Parameter(name) for name in names]


class ValueList(object):
    """A Value List as it looks when it has just been placed."""

    def __init__(self):
        self.ListItems = _Items(Grasshopper.GH_ValueListItem(w, str(k + 1)) for k, w in enumerate("1234"))
        self.expired = 0

    def ExpireSolution(self, recompute):
        assert recompute is False
        self.expired += 1


class _Items(list):
    def Clear(self):
        del self[:]

    Add = list.append


_compiled = {}


def code_of(name):
    """A component's code, compiled once, since Jython takes long for it."""
    if name not in _compiled:
        with io.open(os.path.join(BUILT, name + ".py"), encoding="ascii") as file:
            _compiled[name] = compile(file.read(), name, "exec")
    return _compiled[name]


class Component(object):
    def __init__(self, name):
        self.code = code_of(name)
        with io.open(os.path.join(BUILT, name + ".json"), encoding="utf-8") as file:
            described = json.load(file)
        self.inputs, self.outputs = described["inputs"], described["outputs"]
        self.hints, self.lists = described["hints"], described["lists"]
        self.InstanceGuid = uuid.uuid4()
        self.RunCount = 1
        self.Params = Parameters(self.inputs)
        self.document = Grasshopper.GH_Document()
        self.scope = {"ghenv": self, "__name__": "__main__"}
        self.wired = {}
        self.values = {}
        self.messages = []
        self.solved = 0
        self.expired = False
        self.longest = 0.0
        self._message = ""

    @property
    def Component(self):  # ghenv.Component
        return self

    @property
    def Message(self):
        return self._message

    @Message.setter
    def Message(self, text):
        assert Rhino.on_ui_thread(), "Message set from another thread"
        self._message = text

    def AddRuntimeMessage(self, level, text):
        assert Rhino.on_ui_thread()
        self.messages.append((level, text))

    def OnPingDocument(self):
        assert Rhino.on_ui_thread()
        return self.document

    def OnDisplayExpired(self, redraw):
        assert Rhino.on_ui_thread() and redraw is True

    def ExpireSolution(self, recompute):
        assert Rhino.on_ui_thread() and recompute is False
        self.expired = True

    def set(self, **values):
        for name in values:
            assert name in self.inputs, name
        self.wired.update(values)
        return self.solve()

    def solve(self):
        """One solution; an unwired input is None, as in GhPython."""
        for name in self.inputs:
            self.scope[name] = self.cast(name, self.wired.get(name))
        for name in self.outputs:
            self.scope.pop(name, None)
        self.messages = []
        self.solved += 1
        self.expired = False
        start = own_time()
        execute(self.code, self.scope)
        self.longest = max(self.longest, own_time() - start)
        self.values = dict((name, self.scope[name]) for name in self.outputs)
        for name in self.inputs:
            self.scope.pop(name, None)
        return self

    def cast(self, name, value):
        """What the input's type hint makes of what is wired."""
        hint = self.hints[name]
        if name in self.lists:
            return None if value is None else [rules.cast(item, hint) for item in value]
        return rules.cast(value, hint)

    def slot(self):
        return self.scope["scriptcontext"].sticky["hexwrap/%s/%d" % (self.InstanceGuid, self.RunCount)]

    def __getattr__(self, name):
        if name in self.__dict__.get("values", {}):
            return self.values[name]
        raise AttributeError(name)

    def said(self, level):
        return [text for kind, text in self.messages if kind == level]


def pump(components, until, seconds=PATIENCE):
    """Runs the user interface's thread until a condition holds."""
    end = time.time() + seconds
    while not until():
        assert time.time() < end, "waited %g s in vain; messages %r" % (
            seconds,
            [(c.Message, c.messages) for c in components],
        )
        try:
            action = Rhino.RhinoApp.waiting.get(timeout=0.05)
            start = own_time()
            action()
            assert own_time() - start < FREEZE, "the canvas froze"
        except Empty:
            pass
        assert not asked_on_canvas, "the canvas waited for %r" % asked_on_canvas
        for component in components:
            if component.document is None:
                continue
            scheduled, component.document.scheduled = component.document.scheduled, []
            for callback in scheduled:
                callback(component.document)
            if component.expired:
                component.solve()


def settle(component, solved, seconds=PATIENCE):
    """Until the component was solved again by itself."""
    pump([component], lambda: component.solved >= solved, seconds)
    return component
