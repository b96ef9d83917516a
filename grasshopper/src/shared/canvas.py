# --- the canvas: messages, memory between solutions, work in the background -------------------------------
import threading

import Grasshopper
import Rhino
import System


class Task(object):
    """One piece of background work, seen by the work itself: is it still wanted, and what is it doing?"""

    def __init__(self, slot, component):
        self.slot = slot
        self.serial = slot["serial"]
        self.component = component

    def stale(self):
        return self.slot["serial"] != self.serial

    def check(self):
        if self.stale():
            raise Superseded()

    def pause(self, seconds):
        """Sleeps in short naps, so that work nobody wants any more ends soon."""
        end = time.time() + seconds
        while time.time() < end:
            self.check()
            time.sleep(0.05)

    def say(self, text):
        """Shows what goes on below the component, and looks whether the user pressed Esc meanwhile."""
        component, slot, token = self.component, self.slot, self

        def show():
            if token.stale():
                return
            if component.OnPingDocument() is None:  # deleted, or its document closed
                give_up(slot)
            elif Grasshopper.Kernel.GH_Document.IsEscapeKeyDown():
                cancel(slot, component)
            else:
                component.Message = text
                component.OnDisplayExpired(True)

        on_ui_thread(show)


def on_ui_thread(action):
    Rhino.RhinoApp.InvokeOnUiThread(System.Action(action))


def slot_of(component):
    """The memory of one component between solutions, one slot per run: lists on an input run it repeatedly."""
    key = "hexwrap/%s/%d" % (component.InstanceGuid, component.RunCount)
    if key not in scriptcontext.sticky:
        scriptcontext.sticky[key] = {
            "serial": 0,  # counts requests; work whose number is older is superseded
            "wanted": None,  # what was last asked for
            "busy": False,
            "result": None,  # the last good one
            "error": None,
            "cancelled": False,
        }
    return scriptcontext.sticky[key]


def give_up(slot):
    """Nobody waits for the running work any more. The same request will not start by itself again."""
    slot["serial"] += 1
    slot["busy"] = False


def stop(slot):
    """As give_up, but the next request starts afresh even if it is the same."""
    give_up(slot)
    slot["wanted"] = None
    slot["error"] = None
    slot["cancelled"] = False


def cancel(slot, component):
    """The user's Esc."""
    give_up(slot)
    slot["cancelled"] = True
    component.Message = "cancelled"
    component.OnDisplayExpired(True)


def in_background(component, slot, wanted, work, finish=None):
    """Has work(token) done in a thread, once per request; the component is solved again when it ended.

    A request that is running, finished or failed already is not started again; another one supersedes it.
    finish(result) is what only the user interface's thread may do with it; it returns the result to keep.
    """
    if slot["wanted"] == wanted:
        return
    give_up(slot)
    slot["wanted"] = wanted
    slot["busy"] = True
    slot["error"] = None
    slot["cancelled"] = False
    token = Task(slot, component)

    def run():
        result, error = None, None
        try:
            result = work(token)
        except Superseded:
            return
        except Exception as fault:
            error = as_refusal(fault)

        def settle():  # on the UI thread, where requests are made: no race with a newer one
            if token.stale():
                return
            slot["busy"] = False
            slot["error"] = error
            if error is None:
                try:
                    slot["result"] = finish(result) if finish else result
                except Exception as fault:
                    slot["error"] = as_refusal(fault)
            solve_again(component)

        on_ui_thread(settle)

    thread = threading.Thread(target=run)
    thread.daemon = True
    thread.start()


def made_of_job(component, job, work, idle, names):
    """What work(token, url) makes of a job, in the order of names; None for all of them until it is there.

    idle is the word below the component when nothing is to be done.
    """
    slot = slot_of(component)
    if not job:
        stop(slot)
        component.Message = "no job yet"
    else:
        in_background(component, slot, TEXT(job), lambda token, url=TEXT(job): work(token, url))
        state_message(component, slot, idle)
    found = slot["result"] or {}
    return [found.get(name) for name in names]


def as_refusal(fault):
    """Any exception as one sentence for the balloon."""
    if isinstance(fault, Refusal):
        return fault
    return Refusal(
        "hexwrap did not expect this (%s: %s). Check what is wired to the inputs; if it is right, please report it."
        % (type(fault).__name__, words_of(fault))
    )


def solved(component, solve, count):
    """What solve() puts out; after a fault, ``count`` times nothing and one sentence in the balloon."""
    try:
        return solve()
    except Exception as fault:
        component.Message = "failed"
        fail(component, as_refusal(fault).message)
        return (None,) * count


def solve_again(component):
    document = component.OnPingDocument()
    if document is not None:
        expire = Grasshopper.Kernel.GH_Document.GH_ScheduleDelegate(lambda _: component.ExpireSolution(False))
        document.ScheduleSolution(1, expire)


def listen_for_escape(slot, component):
    """Rhino tells of a short press of Esc that falls between two looks at the key."""
    if slot.get("listens"):
        return
    slot["listens"] = True

    def pressed(sender, event):
        if slot["busy"]:
            cancel(slot, component)

    Rhino.RhinoApp.EscapeKeyPressed += System.EventHandler(pressed)


def state_message(component, slot, idle):
    """The word below the component, and the one error or remark in its balloon."""
    if slot["cancelled"]:
        component.Message = "cancelled"
        remark(component, "Cancelled. Toggle Run to start again.")
    elif slot["error"] is not None:
        component.Message = "failed"
        fail(component, slot["error"].message)
    elif slot["busy"]:
        component.Message = component.Message or "working"
    else:
        component.Message = idle


def fail(component, text):
    component.AddRuntimeMessage(Grasshopper.Kernel.GH_RuntimeMessageLevel.Error, text)


def warning(component, text):
    component.AddRuntimeMessage(Grasshopper.Kernel.GH_RuntimeMessageLevel.Warning, text)


def remark(component, text):
    component.AddRuntimeMessage(Grasshopper.Kernel.GH_RuntimeMessageLevel.Remark, text)


def tree_of(branches):
    """{branch number: [item ...]} as a data tree."""
    tree = Grasshopper.DataTree[System.Object]()
    for number in sorted(branches):
        path = Grasshopper.Kernel.Data.GH_Path(number)
        for item in branches[number]:
            tree.Add(boxed(item), path)
    return tree


def boxed(item):
    """Whole numbers as .NET's own: where an object is taken, CPython would hand over one of Python's."""
    return System.Int32(item) if type(item) is int else item
