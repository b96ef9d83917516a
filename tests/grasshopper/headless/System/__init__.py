"""What the components use of .NET's System, for CPython and Jython alike."""

import System.Drawing


class Object(object):
    pass


class Int32(int):
    """A whole number of .NET's own."""


class Action(object):
    """A delegate: Rhino's own methods take nothing else."""

    def __init__(self, function):
        assert callable(function)
        self.function = function

    def __call__(self, *arguments):
        return self.function(*arguments)


class EventHandler(Action):
    pass


class _TypedArray(object):
    def __init__(self, kind):
        self.kind = kind

    def __call__(self, items):
        items = list(items)
        for item in items:
            assert isinstance(item, self.kind), "%r is no %s" % (item, self.kind.__name__)
        return tuple(items)


class _Array(object):
    def __getitem__(self, kind):
        return _TypedArray(kind)


Array = _Array()
