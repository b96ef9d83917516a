"""What the components use of Rhino: the user interface's thread, geometry, and a document."""

import threading

import Rhino.DocObjects
import Rhino.Geometry

try:
    from Queue import Queue
except ImportError:
    from queue import Queue

import System

UI_THREAD = threading.current_thread()


def on_ui_thread():
    return threading.current_thread() is UI_THREAD


class _Event(object):
    def __init__(self):
        self.handlers = []

    def __iadd__(self, handler):
        assert isinstance(handler, System.EventHandler) and on_ui_thread()
        self.handlers.append(handler)
        return self

    def fire(self):
        for handler in self.handlers:
            handler(None, None)


class RhinoApp(object):
    waiting = Queue()
    EscapeKeyPressed = _Event()

    @staticmethod
    def InvokeOnUiThread(action):
        assert isinstance(action, System.Action), "InvokeOnUiThread takes a delegate"
        RhinoApp.waiting.put(action)


class RhinoDoc(object):
    ActiveDoc = None  # a scenario opens one
