"""The built components, unpacked once; interpreters that run them."""

import http.client
import json
import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from grasshopper import archive, components
from hexwrap_server import samples
from hexwrap_server.input.requests import SentSurface
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.jobs.work import take_in
from tests.server import forked
from tests.server.patience import PATIENCE, until

ROOT = Path(__file__).resolve().parents[2]
HEADLESS = Path(__file__).parent / "headless"
DIST = ROOT / "grasshopper" / "dist"

#: Java's best compiler takes longer than what it would speed up here; Jython would list every package of Java
#: and leave class files behind.
QUICK_JAVA = {
    "JAVA_TOOL_OPTIONS": "-XX:TieredStopAtLevel=1 -XX:+UseSerialGC -Dpython.cachedir.skip=true",
    "PYTHONDONTWRITEBYTECODE": "1",
}

Runner = Callable[[list[str], dict[str, str]], None]


@pytest.fixture(scope="session")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder per form with the code and the parameters out of every built ``.ghuser``."""
    folder = tmp_path_factory.mktemp("components")
    for form in components.FORMS:
        (folder / form.name).mkdir()
        for path in (DIST / form.name).glob("*.ghuser"):
            inner = archive.inflate(archive.inflate(path.read_bytes())["Object"])
            unpack(inner, path.stem.removeprefix("hexwrap-"), form, folder / form.name)
        for path in (DIST / form.name).glob("*.gh"):
            unpack_network(path, form, folder / form.name / path.stem.removeprefix("hexwrap-"))
    return folder


def unpack_network(path: Path, form: components.Form, folder: Path) -> None:
    """The components of a definition; in ``network.json`` what stands on the canvas, and its wires."""
    folder.mkdir()
    things = []
    for chunk in archive.inflate(path.read_bytes()).find("Definition", "DefinitionObjects").chunks:
        box, name = chunk.find("Container"), chunk["Name"]
        if name == "Group":
            continue
        thing = {"name": name, "nickname": box["NickName"], "id": str(box["InstanceGuid"])}
        if components.code_of(box) is not None:
            thing["script"] = name.removeprefix("hexwrap ").replace(" ", "")
            unpack(box, thing["script"], form, folder)
            box = box.find("ParameterData")
        ends = [c for c in box.chunks if c.name in ("InputParam", "param_input")]
        starts = [c for c in box.chunks if c.name == "OutputParam"]
        thing["wires"] = {c["Name"]: sources(c) for c in ends} if ends else {"": sources(box)}
        thing["starts"] = {str(c["InstanceGuid"]): c["Name"] for c in starts} or {thing["id"]: ""}
        thing["items"] = held(name, box)
        things.append(thing)
    (folder / "network.json").write_text(json.dumps(things), encoding="utf-8")


def sources(chunk: archive.Chunk) -> list[str]:
    return [str(item.value) for item in chunk.items if item.name == "Source"]


def held(name: str, box: archive.Chunk) -> list[object]:
    """What an object hands on that nothing is wired to, as it is when the file is opened."""
    if name == "Panel":
        whole = box.find("PanelProperties")["Multiline"]
        return [box["UserText"]] if whole else box["UserText"].split("\n")
    if name == "Number Slider":
        return [box.find("Slider")["Value"]]
    if name == "Value List":
        entries = [c for c in box.chunks if c.name == "ListItem"]
        return [c["Expression"].strip('"') for c in entries if c["Selected"]]
    if name == "Boolean Toggle":
        return [box["ToggleValue"]]
    return [False] if name == "Button" else []


@pytest.fixture(scope="session")
def sample_meshes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the meshes of samples, as Rhino would make them."""
    folder = tmp_path_factory.mktemp("meshes")
    for name in ("entrance", "dome"):
        asked = samples.load(name)
        if "mesh" in asked["surface"]:
            asked["surface"]["mesh"] = {"max_edge": 0.7}
        request = parse_request(asked, 10**6, 10**6)
        assert isinstance(request.surface, SentSurface)
        surface = take_in(request.surface, request.wanted.surface)
        rows = {"vertices": surface.vertices.tolist(), "faces": surface.faces.tolist()}
        (folder / f"{name}.json").write_text(json.dumps(rows), encoding="ascii")
    return folder


def unpack(inner: archive.Chunk, name: str, form: components.Form, folder: Path) -> None:
    data = inner.find("ParameterData")
    inputs = [c for c in data.chunks if c.name == "InputParam"]
    code = components.code_of(inner)
    assert code is not None
    (folder / f"{name}.py").write_text(code, encoding="ascii")
    hint = {guid: word for word, guid in form.hints.items()}
    # The new form takes its variables from the names, the old one from the nicknames.
    key = "NickName" if form is components.RHINO7 else "Name"
    described = {
        "inputs": [c[key] for c in inputs],
        "outputs": [c[key] for c in data.chunks if c.name == "OutputParam"],
        "hints": {c[key]: hint[c["TypeHintID"]] for c in inputs},
        "lists": [c[key] for c in inputs if c["ScriptParamAccess"] == 1],
    }
    (folder / f"{name}.json").write_text(json.dumps(described), encoding="utf-8")


SERVE = (
    "from hexwrap_server.http.app import serve; from hexwrap_server.settings import Settings; "
    "from tests.server import forked; forked.fork_from_here(); serve(Settings.from_environment())"
)


@pytest.fixture(scope="session")
def server_port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """Port of a live server process with a data folder of its own."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port = int(listener.getsockname()[1])
    folder = tmp_path_factory.mktemp("server")
    settings = {"HEXWRAP_PORT": str(port), "HEXWRAP_DATA": str(folder / "data")}
    log = folder / "server.log"
    with log.open("wb") as said:
        process = forked.popen(
            [sys.executable, "-c", SERVE],
            env=os.environ | settings | {"PYTHONPATH": forked.paths()},
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=said,
        )
    try:

        def ready() -> bool:
            assert process.poll() is None, f"the server did not start:\n{log.read_text()}"
            return is_ready(port)

        until(ready, "the server")
        yield port
    finally:
        process.terminate()
        process.wait(PATIENCE)


def is_ready(port: int) -> bool:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    try:
        connection.request("GET", "/ready")
        return connection.getresponse().status == 200
    except OSError:
        return False
    finally:
        connection.close()


@pytest.fixture(params=["cpython", "jython"])
def run_scenarios(request: pytest.FixtureRequest, unpacked: Path) -> Runner:
    """Runs files of scenarios in another interpreter; their failures are this test's.

    Each runs the form that its Rhino has: IronPython's rules for Rhino 7, Python.NET's for Rhino 8.
    """
    if request.param == "cpython":
        command, form = [sys.executable], components.RHINO8
    else:
        form = components.RHINO7
        found = shutil.which("jython")
        if found is None:
            pytest.skip(
                "Jython 2.7 is not installed here; '.ci/run' installs it, as does 'apt install jython'"
            )
        command = [found]

    settings = {
        "HEXWRAP_BUILT": str(unpacked / form.name),
        "HEXWRAP_RULES": form.name,
        "HEXWRAP_PYTHON": sys.executable,
        "PYTHONPATH": forked.paths(),
    }

    def run(names: list[str], environment: dict[str, str]) -> None:
        done = subprocess.run(
            [*command, str(HEADLESS / "scenarios.py"), *names],
            env=os.environ | QUICK_JAVA | settings | environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=4 * PATIENCE,
            check=False,
        )
        print(done.stdout)
        assert done.returncode == 0, f"\n{done.stdout}"
        assert "passed" in done.stdout

    return run
