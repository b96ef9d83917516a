"""Servers that are down, die, come back, or are started from the canvas."""

from __future__ import print_function

import json
import os
import shutil
import signal
import socket
import stat
import sys
import tempfile
import time
import types

import world
from canvas import Component, pump, settle

LARGE = json.dumps({"pattern": {"around": 240}})
SMALL = json.dumps({"pattern": {"around": 16}})
FOLDER = tempfile.mkdtemp()


def server_down():
    port = world.free_port()
    send = Component("Send").set(Mesh=world.tube(), Run=True, Port=port)
    settle(send, 2)
    assert send.solved == 2
    assert len(send.said("error")) == 1
    assert "hexwrap serve" in send.said("error")[0] and str(port) in send.said("error")[0]
    send.solve()  # no endless loop of tries, and still the same words
    assert len(send.said("error")) == 1 and not send.document.scheduled
    job = "http://127.0.0.1:%d/v1/jobs/x" % port
    others = [Component(name).set(Job=job) for name in ("Collect", "Domain", "Support")]
    pump(others, lambda: all(made.solved == 2 for made in others))
    for made in others:
        assert len(made.said("error")) == 1 and "stopped answering" in made.said("error")[0]


def server_hangs():
    """It takes questions and answers none of them."""
    listener = socket.socket()
    listener.bind(("127.0.0.1", 0))
    listener.listen(50)
    collect = Component("Collect").set(Job="http://127.0.0.1:%d/v1/jobs/x" % listener.getsockname()[1])
    settle(collect, 2)
    assert len(collect.said("error")) == 1 and "stopped answering" in collect.said("error")[0]
    listener.close()


def server_dies_in_mid_job():
    server = world.Server(world.free_port(), os.path.join(FOLDER, "first"))
    send = Component("Send").set(Mesh=world.tube(), Pattern=SMALL, Run=True, Port=server.port)
    good = settle(send, 2).Job
    assert good
    send.set(Pattern=LARGE)
    pump([send], lambda: world.ask(server.port, "GET", "/health")[1]["running"] == 1)
    server.kill()
    settle(send, 4)
    assert len(send.said("error")) == 1 and "stopped answering" in send.said("error")[0]
    assert send.Job == good, "the last good job is held"
    # another one takes its place, which has never seen the mesh: it is sent once more
    again = world.Server(server.port, os.path.join(FOLDER, "second"))
    try:
        settle(send.set(Pattern=json.dumps({"pattern": {"around": 18}})), 6)
        assert send.Job and send.Job != good and not send.messages, send.messages
    finally:
        again.kill()


def tokens_are_handed_on():
    port = world.free_port()
    os.environ["HEXWRAP_TOKEN"] = "not-for-everybody"
    try:
        server = world.Server(port, os.path.join(FOLDER, "token"))
    finally:
        del os.environ["HEXWRAP_TOKEN"]
    try:
        send = Component("Send").set(Mesh=world.tube(), Pattern=SMALL, Run=True, Port=port)
        assert "oken" in settle(send, 2).said("error")[0]
        settle(send.set(Token="not-for-everybody", Name="again"), 4)
        assert send.Job, send.messages
        assert settle(Component("Collect").set(Job=send.Job), 2).Panels is not None
    finally:
        server.kill()


# --- Start Server ----------------------------------------------------------------------------------------


def running_servers_are_found():
    start = settle(Component("StartServer").set(Start=True, Port=int(os.environ["HEXWRAP_PORT"])), 2)
    assert start.Running is True and start.Status.startswith("running: hexwrap")
    assert start.set(Start=False).Running is False


def missing_programs_are_explained():
    start = Component("StartServer").set(Start=True, Port=world.free_port(), Program="/no/such/hexwrap")
    settle(start, 2)
    assert start.Running is False
    assert len(start.said("error")) == 1 and "pipx install" in start.said("error")[0]


def program():
    """A program that serves, and writes its process number down."""
    path, note = os.path.join(FOLDER, "hexwrap"), os.path.join(FOLDER, "pid")
    with open(path, "w") as file:
        file.write('#!/bin/sh\necho $$ > "%s"\n' % note)
        file.write('export HEXWRAP_PORT="$3" HEXWRAP_DATA="%s"\n' % os.path.join(FOLDER, "started"))
        file.write("exec \"%s\" -c '%s'\n" % (world.PYTHON, world.SERVE))
    os.chmod(path, os.stat(path).st_mode | stat.S_IXUSR)
    return path, note


def stop_started(note):
    with open(note) as file:
        os.kill(int(file.read()), signal.SIGTERM)


def servers_are_started():
    if os.sep != "/":
        return  # the stand-in for the program is a shell script
    path, note = program()
    start = Component("StartServer").set(Start=True, Port=world.free_port(), Program=path)
    settle(start, 2)
    try:
        assert start.Running is True and start.Status.startswith("started: hexwrap"), start.messages
        assert world.answers(start.wired["Port"])
    finally:
        stop_started(note)


def servers_are_started_through_dotnet():
    """Inside Rhino, .NET starts the process."""
    started = []

    class ProcessStartInfo(object):
        def __init__(self, program, arguments):
            self.words = [program] + arguments.split()

    class Process(object):
        @staticmethod
        def Start(info):
            assert info.UseShellExecute is False and info.CreateNoWindow is True
            started.append(info.words)
            raise RuntimeError("access denied")

    module = types.ModuleType("System.Diagnostics")
    module.Process, module.ProcessStartInfo = Process, ProcessStartInfo
    sys.modules["System.Diagnostics"] = module
    try:
        port = world.free_port()
        start = Component("StartServer").set(Start=True, Port=port, Program=os.path.abspath(world.__file__))
        settle(start, 2)
        assert [words[1:] for words in started] == [["serve", "--port", str(port)]], started
        assert "could not be started" in start.said("error")[0]
        assert "access denied" in start.said("error")[0]
    finally:
        del sys.modules["System.Diagnostics"]


try:
    world.run([
        server_down,
        server_hangs,
        server_dies_in_mid_job,
        tokens_are_handed_on,
        running_servers_are_found,
        missing_programs_are_explained,
        servers_are_started,
        servers_are_started_through_dotnet,
    ])  # fmt: skip
finally:
    shutil.rmtree(FOLDER, ignore_errors=True)
