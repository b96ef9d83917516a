# --- the server, over HTTP -------------------------------------------------------------------------------
# Runs under IronPython 2.7, Jython 2.7 and CPython 3: no third-party module, no syntax of one side only.
import json
import socket
import time

import scriptcontext

try:
    import urllib2 as url_library  # novermin
    from httplib import HTTPException  # novermin
except ImportError:
    import urllib.request as url_library
    from http.client import HTTPException

TEXT = type(u"")
QUICK = 5.0  # seconds for calls that only ask
SLOW = 120.0  # seconds for calls that carry a mesh or a result
HOLD = 0.5  # seconds the server holds a question for a job's state: how soon a cancel is noticed
PATIENCE = 5.0  # seconds without an answer after which a server counts as gone


# Servers for others than this computer ask for a token; Send hands it to all components of the document.
TOKENS = scriptcontext.sticky.setdefault("hexwrap/tokens", {})


class Refusal(Exception):
    """What a person reads. problem: the server's own words (RFC 9457), empty where it was not asked."""

    def __init__(self, message, problem=None):
        Exception.__init__(self, message)
        self.message = message
        self.problem = problem or {}


class Offline(Refusal):
    """Nothing answers at the address."""


class Superseded(Exception):
    """Nobody waits for this work any more."""


def offline(server):
    return Offline(
        "No hexwrap server answers at %s. Start it with 'hexwrap serve' in a terminal or with the component "
        "Start Server, and check IP and Port." % server
    )


def call(server, method, path, body=None, kind="application/json", timeout=QUICK):
    """Body of the answer as bytes. Raises Refusal with the server's sentence, Offline without an answer."""
    headers = {"Accept": "application/json"}
    if body is not None:
        headers["Content-Type"] = kind
    if TOKENS.get(server):
        headers["Authorization"] = str("Bearer " + TOKENS[server])
    # Python 2 must not mix its two kinds of text here, or it cannot join the head with the bytes of the body.
    request = url_library.Request(str(server + path), body, headers)
    request.get_method = lambda: method
    # The server is on this machine or named by its number: a proxy could only be in the way.
    opener = url_library.build_opener(url_library.ProxyHandler({}))
    try:
        answer = opener.open(request, timeout=timeout)
        try:
            return answer.read()
        finally:
            answer.close()
    except url_library.HTTPError as error:
        try:
            content = error.read()
        finally:
            error.close()
        raise refusal(error.code, content)
    except (EnvironmentError, socket.error, HTTPException) as error:  # refused, reset, timed out, cut short
        if isinstance(error, socket.timeout) or "timed out" in words_of(error):
            raise Offline("The server at %s did not answer within %g seconds." % (server, timeout))
        raise offline(server)


def call_json(server, method, path, document=None, timeout=QUICK):
    body = None if document is None else json_text(document).encode("utf-8")
    content = call(server, method, path, body, timeout=timeout)
    return json.loads(content.decode("utf-8")) if content else None


def json_text(document):
    """JSON with every letter as it is: IronPython, whose str holds any letter, takes those beyond ASCII for
    bytes when it is to escape them, and fails."""
    return json.dumps(document, ensure_ascii=False, sort_keys=True)


def words_of(error):
    """What an exception says; Python 2 may hold it as bytes of the system's own language."""
    try:
        return TEXT(error)
    except UnicodeError:
        return str(error).decode("utf-8", "replace")  # novermin


def refusal(status, content):
    try:
        problem = json.loads(content.decode("utf-8"))
        sentence = problem["detail"]
    except Exception:
        return Refusal("The server answered with status %d and no explanation." % status, {"status": status})
    problem.setdefault("status", status)
    return Refusal(sentence, problem)


def split_job(url):
    """http://host:port/v1/jobs/ID -> (http://host:port, ID). Raises Refusal."""
    server, found, name = TEXT(url).strip().rstrip("/").partition("/v1/jobs/")
    if not found or not name or "/" in name:
        raise Refusal("This is no job: wire the output Job of the component Send here.")
    return server, name


def forget_job(server, name):
    """Stops a job if it still runs; whether anybody hears it does not matter."""
    try:
        call(server, "DELETE", "/v1/jobs/" + name)
    except Refusal:
        pass


def wait_for_job(server, name, token, give_up_at=None):
    """The Job once it has ended. Raises Refusal, or Superseded when the token is."""
    heard = time.time()
    while True:
        token.check()
        if give_up_at is not None and time.time() > give_up_at:
            forget_job(server, name)
            raise Refusal("The job was not finished within TimeOut, so it was cancelled. Give it more seconds.")
        try:
            job = call_json(server, "GET", "/v1/jobs/%s?wait=%r" % (name, HOLD), timeout=HOLD + QUICK)
        except Offline:
            if time.time() - heard > PATIENCE:  # by the clock: a question may be left open for seconds
                raise Refusal(
                    "The server at %s stopped answering while it worked. Start it again: it remembers its "
                    "jobs." % server
                )
            token.say("no answer, trying again")
            token.pause(1.0)
            continue
        heard = time.time()
        if job["status"] in ("done", "failed", "cancelled"):
            return job
        token.say(progress_text(job))


def progress_text(job):
    if job["status"] == "queued":
        return "waiting in the queue"
    return "%s %d %%" % (job.get("stage") or "working", round(100 * (job.get("progress") or 0)))


def fetch(server, name, parts):
    """Parts of a finished job's result."""
    return call_json(server, "GET", "/v1/jobs/%s/result?include=%s" % (name, ",".join(parts)), timeout=SLOW)


def finished(url, token, parts):
    """Waits for the job of this address and fetches parts of its result. Raises Refusal, Superseded."""
    server, name = split_job(url)
    job = wait_for_job(server, name, token)
    if job["status"] == "cancelled":
        raise Refusal("The job was cancelled.")
    token.say("collecting")
    return fetch(server, name, parts)
