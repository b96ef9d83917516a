"""Starts a hexwrap server on this machine if none answers yet, and tells how to install one."""

# include: wire canvas
import os

WAIT = 30.0  # seconds that a server may take to come up
HOW_TO_INSTALL = (
    "No program 'hexwrap' was found. Install it once: with Python 3.11 or newer, run 'pipx install .' in a terminal "
    "in hexwrap's own folder. If it is installed elsewhere, wire the full path of the program to Program."
)


def usual_folders():
    """Where pip and pipx put programs; an application started from a dock does not see the shell's PATH."""
    home = os.path.expanduser("~")
    folders = (os.environ.get("PATH") or "").split(os.pathsep)
    folders += [os.path.join(home, ".local", "bin"), "/opt/homebrew/bin", "/usr/local/bin"]
    for base in (os.environ.get("LOCALAPPDATA"), os.environ.get("APPDATA")):
        for root in [os.path.join(base, "Programs", "Python"), os.path.join(base, "Python")] if base else []:
            if os.path.isdir(root):
                folders += [os.path.join(root, name, "Scripts") for name in sorted(os.listdir(root))]
    return [folder for folder in folders if folder]


def find_program(given):
    """Full path of hexwrap, or None."""
    if given:
        return given if os.path.isfile(given) else None
    for folder in usual_folders():
        for name in ("hexwrap.exe", "hexwrap"):
            path = os.path.join(folder, name)
            if os.path.isfile(path):
                return path
    return None


def launch(program, port):
    """Starts the server without a window; it goes on when Rhino is closed."""
    try:
        from System.Diagnostics import Process, ProcessStartInfo
    except ImportError:
        import subprocess

        # Not closed again: Jython passes the server's words on by threads that go on after this.
        silence, nothing = open(os.devnull, "rb"), open(os.devnull, "wb")
        command = [program, "serve", "--port", str(port)]
        subprocess.Popen(command, stdin=silence, stdout=nothing, stderr=nothing)
        return
    start = ProcessStartInfo(program, "serve --port %d" % port)
    start.UseShellExecute = False
    start.CreateNoWindow = True
    Process.Start(start)


def version(server):
    return call_json(server, "GET", "/health")["version"]


def start_server(token, server, port, program):
    """Work of the background thread."""
    token.say("looking")
    try:
        return "running: hexwrap %s at %s" % (version(server), server)
    except Offline:
        pass
    found = find_program(program)
    if found is None:
        raise Refusal(HOW_TO_INSTALL)
    token.say("starting")
    try:
        launch(found, port)
    except Exception as failed:
        raise Refusal("%s could not be started: %s" % (found, failed))
    end = time.time() + WAIT
    while time.time() < end:
        try:
            return "started: hexwrap %s at %s" % (version(server), server)
        except Offline:
            token.pause(0.5)
    raise Refusal(
        "%s was started but does not answer at %s. Run 'hexwrap serve --port %d' in a terminal to see why."
        % (found, server, port)
    )


def request(slot):
    port = int(Port or 6789)
    server = "http://127.0.0.1:%d" % port
    program = TEXT(Program) if Program else None
    in_background(
        component, slot, (server, program), lambda token: start_server(token, server, port, program)
    )


def solve():
    slot = slot_of(component)
    if not Start:
        stop(slot)
        slot["result"] = None
        component.Message = "Start is off"
    else:
        request(slot)
        state_message(component, slot, "running")
    return slot["result"] or component.Message, slot["result"] is not None


component = ghenv.Component
Status, Running = solved(component, solve, 2)
