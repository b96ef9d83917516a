"""What scenarios need around the canvas: meshes as Rhino makes them, servers, and a spy on the wire.

Runs under CPython 3 and Jython 2.7.
"""

from __future__ import print_function

import json
import math
import os
import socket
import subprocess
import sys
import threading
import time
import traceback

from Rhino.Geometry import Mesh

try:
    from BaseHTTPServer import BaseHTTPRequestHandler, HTTPServer
    from httplib import HTTPConnection
    from SocketServer import ThreadingMixIn
except ImportError:
    from http.client import HTTPConnection
    from http.server import BaseHTTPRequestHandler, HTTPServer
    from socketserver import ThreadingMixIn

PYTHON = os.environ["HEXWRAP_PYTHON"]
SERVE = (
    "from hexwrap_server.http.app import serve; from hexwrap_server.settings import Settings; "
    "from tests.server import forked; forked.fork_from_here(); serve(Settings.from_environment())"
)


# --- meshes ----------------------------------------------------------------------------------------------


def tube(around=24, high=10, waist=0.75, height=6.0, normals=False):
    """A waisted tube of quads with an unwelded seam, as Rhino meshes a surface of revolution."""
    points, faces = [], []
    for row in range(high + 1):
        z = height * row / high
        radius = 2.0 + waist * math.cos(2.0 * math.pi * row / high)
        for k in range(around + 1):  # the seam's points are there twice
            a = 2.0 * math.pi * (k % around) / around
            points.append((radius * math.cos(a), radius * math.sin(a), z))
    for row in range(high):
        for k in range(around):
            a = row * (around + 1) + k
            faces.append((a, a + 1, a + around + 2, a + around + 1))
    return Mesh(points, faces, [(p[0], p[1], 0.0) for p in points] if normals else ())


def with_lid(mesh, depth=0.0):
    """One end closed: a cup, which has one boundary loop only."""
    around = mesh.Vertices.Count // 11 - 1
    points, faces = list(mesh.Vertices.points), list(mesh.Faces.rows)
    points.append((0.0, 0.0, -depth))
    faces += [(k + 1, k, len(points) - 1) for k in range(around)]
    return Mesh(points, faces)


def torus(around=12, across=8):
    """A surface with a handle."""
    points, faces = [], []
    for k in range(around):
        for j in range(across):
            a, b = 2.0 * math.pi * k / around, 2.0 * math.pi * j / across
            radius = 3.0 + math.cos(b)
            points.append((radius * math.cos(a), radius * math.sin(a), math.sin(b)))
            after, above = (k + 1) % around, (j + 1) % across
            corners = ((k, j), (after, j), (after, above), (k, above))
            faces.append(tuple(across * row + place for row, place in corners))
    return Mesh(points, faces)


def with_fin(mesh):
    """A third face on an edge inside."""
    points, faces = list(mesh.Vertices.points), list(mesh.Faces.rows)
    a, b = faces[len(faces) // 2][1:3]
    points.append(tuple(c * 1.5 for c in points[a]))
    faces.append((a, b, len(points) - 1))
    return Mesh(points, faces), (points[a], points[b])


# --- servers ---------------------------------------------------------------------------------------------


def free_port():
    listener = socket.socket()
    listener.bind(("127.0.0.1", 0))
    listener.listen(1)  # only now does Jython choose
    port = listener.getsockname()[1]
    listener.close()
    assert port > 0
    return port


def ask(port, method, path, body=None):
    """(status, document) straight from a server, past the components."""
    connection = HTTPConnection("127.0.0.1", port, timeout=300)
    try:
        connection.request(method, str(path), body)
        answer = connection.getresponse()
        content = answer.read()
        return answer.status, json.loads(content.decode("utf-8")) if content else None
    finally:
        connection.close()


def answers(port):
    try:
        return ask(port, "GET", "/health")[0] == 200
    except Exception:
        return False


class Server(object):
    """A server process of its own."""

    def __init__(self, port, data):
        environment = dict(os.environ)
        environment.update({"HEXWRAP_PORT": str(port), "HEXWRAP_DATA": data, "HEXWRAP_WORKERS": "1"})
        self.port = port
        # Jython passes the server's words on by threads: nothing may be closed behind them.
        silence, self.nothing = open(os.devnull, "rb"), open(os.devnull, "wb")
        self.process = subprocess.Popen(
            [PYTHON, "-c", SERVE], stdin=silence, stdout=self.nothing, stderr=self.nothing, env=environment
        )
        end = time.time() + 300
        while not answers(port):
            assert time.time() < end and self.process.poll() is None, "the server did not come up"
            time.sleep(0.1)

    def kill(self):
        self.process.kill()
        self.process.wait()


class Spy(object):
    """Passes requests on to a server and remembers them as (method, path, body)."""

    def __init__(self, target):
        self.seen = seen = []

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.0"

            def handle_one(self):
                body = self.rfile.read(int(self.headers.get("Content-Length") or 0)) or None
                seen.append((self.command, self.path, body))
                connection = HTTPConnection("127.0.0.1", target, timeout=300)
                headers = {"Content-Type": self.headers.get("Content-Type") or "application/json"}
                connection.request(self.command, self.path, body, headers)
                answer = connection.getresponse()
                content = answer.read()
                connection.close()
                try:
                    self.send_response(answer.status)
                    self.send_header("Content-Type", answer.getheader("Content-Type") or "")
                    self.send_header("Content-Length", str(len(content)))
                    self.end_headers()
                    self.wfile.write(content)
                except (OSError, ValueError):
                    pass  # whoever asked has left

            do_GET = do_POST = do_DELETE = handle_one

            def log_message(self, *arguments):
                pass

        class Threaded(ThreadingMixIn, HTTPServer):
            daemon_threads = True

        self.server = Threaded(("127.0.0.1", 0), Handler)
        self.port = self.server.server_address[1]
        thread = threading.Thread(target=self.server.serve_forever)
        thread.daemon = True
        thread.start()

    def count(self, method, start):
        return len(self.bodies(method, start))

    def bodies(self, method, start):
        return [body for verb, path, body in list(self.seen) if verb == method and path.startswith(start)]

    def close(self):
        self.server.shutdown()
        self.server.server_close()


# --- running ---------------------------------------------------------------------------------------------


def run(scenarios):
    """Runs functions one after the other; ends with status 1 if one of them fails."""
    failed = 0
    chosen = sys.argv[1:]
    for scenario in scenarios:
        if chosen and scenario.__name__ not in chosen:
            continue
        start = time.time()
        try:
            scenario()
            print("passed %s (%.1f s)" % (scenario.__name__, time.time() - start))
        except Exception:
            failed += 1
            print("FAILED %s" % scenario.__name__)
            traceback.print_exc(file=sys.stdout)
        sys.stdout.flush()
    sys.exit(1 if failed else 0)
