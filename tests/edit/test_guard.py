"""Every request but those of the editor's own page is refused, and changes nothing."""

from __future__ import annotations

import json

import pytest

from asterism.edit.messages import parsed
from asterism.errors import ParameterError
from asterism.reporting.guard import MAX_BYTES
from tests.edit.served import Served, write_capture

EDIT = json.dumps({"kind": "clutter", "detections": [0], "name": ""}).encode()


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    folder = tmp_path_factory.mktemp("guarded")
    write_capture(folder)
    made = Served(folder)
    yield made
    # Nothing of what was refused has changed anything.
    assert not (folder / "trial.edits.toml").exists()
    assert made.stop() == (0, "")


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"X_Asterism_Token": None}, "Token"),
        ({"X_Asterism_Token": ""}, "Token"),
        ({"X_Asterism_Token": "guessed"}, "Token"),
        ({"X_Asterism_Token": "é".encode()}, "Token"),
        ({"Host": "attacker.example"}, "Host"),  # DNS rebinding
        ({"Host": "attacker.example:{port}"}, "Host"),
        ({"Host": "127.0.0.1"}, "Host"),
        ({"Host": "127.0.0.1:{port}.attacker.example"}, "Host"),
        ({"Host": ["127.0.0.1:{port}", "attacker.example"]}, "Host"),
        ({"Host": None}, "Host"),
        ({"Origin": "https://attacker.example"}, "Origin"),
        ({"Origin": "http://127.0.0.1:1"}, "Origin"),
        ({"Origin": "https://127.0.0.1:{port}"}, "Origin"),
        ({"Origin": "null"}, "Origin"),
        ({"Origin": None}, "Origin"),
    ],
    ids=str,
)
def test_foreign_requests_are_refused(served, changes, reason):
    def own(value):
        if isinstance(value, list):
            return [own(each) for each in value]
        return value.format(port=served.port) if isinstance(value, str) else value

    headers = served.headers(**{name: own(value) for name, value in changes.items()})
    status, text = served.request("POST", "/do/edit", EDIT, **headers)
    if status == 400:  # the server of HTTP itself refuses it
        assert changes["Host"] is None or isinstance(changes["Host"], list)
        return
    assert status == 403
    assert text.startswith(f"{reason}: expected ")
    assert served.token not in text


@pytest.mark.parametrize("path", ["/", "/?token=guessed", "/?token=", "/events", "/events?token=x"])
def test_page_and_events_need_the_token(served, path):
    status, text = served.request("GET", path, Host=served.own)
    assert (status, text.split(":")[0]) == (403, "Token")


def test_token_of_the_address_is_for_the_page_alone(served):
    for method, path in (("GET", "/events"), ("POST", "/do/undo")):
        headers = served.headers(X_Asterism_Token=None)
        path += f"?token={served.token}"
        assert served.request(method, path, b"{}" * (method == "POST"), **headers)[0] == 403
    assert served.request("GET", f"/?token={served.token}", Host=served.own)[0] == 200


def test_the_page_is_for_no_frame_and_no_cache(served):
    import http.client

    link = http.client.HTTPConnection("127.0.0.1", served.port)
    link.request("GET", f"/?token={served.token}")
    answer = link.getresponse()
    headers = {name.lower(): value for name, value in answer.getheaders()}
    page = answer.read().decode()
    link.close()
    assert headers["content-security-policy"] == "frame-ancestors 'none'"
    assert headers["cache-control"] == "no-store"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cross-origin-resource-policy"] == "same-origin"
    assert "access-control-allow-origin" not in headers
    policy = page.split('Content-Security-Policy" content="')[1].split('"')[0]
    assert "default-src &#x27;none&#x27;" in policy
    assert "connect-src &#x27;self&#x27;" in policy
    assert "http" not in policy
    assert served.token not in page


def test_long_messages_are_refused(served):
    long = b" " * (MAX_BYTES + 1)
    status, text = served.request("POST", "/do/edit", long, **served.headers())
    assert (status, text) == (413, f"message: expected at most {MAX_BYTES} bytes.\n")
    # Before its body comes, and where the length is not said.
    headers = served.headers(Content_Length="1000000000000")
    assert served.request("POST", "/do/edit", **headers)[0] == 413
    chunk = f"{len(long):x}\r\n".encode() + long + b"\r\n0\r\n\r\n"
    headers = served.headers(Transfer_Encoding="chunked")
    assert served.request("POST", "/do/edit", chunk, **headers)[0] == 413


@pytest.mark.parametrize(
    ("action", "body", "reason"),
    [
        ("edit", b"", "message: expected JSON"),
        ("edit", b"{", "message: expected JSON"),
        ("edit", b"\xff\xfe", "message: expected JSON"),
        ("edit", b"[" * 5000, "message: expected JSON"),
        ("edit", b"[]", "message: expected a JSON object, found list"),
        ("edit", b"{}", "message: expected the fields kind, detections, name, found none"),
        ("edit", EDIT.replace(b"}", b', "path": "/etc"}'), "message: expected the fields"),
        ("edit", EDIT.replace(b"clutter", b"all"), "kind: expected same or"),
        ("edit", EDIT.replace(b"[0]", b"[]"), "detections: expected a list of numbers"),
        ("edit", EDIT.replace(b"[0]", b"[0, 1, 2, 3]"), "detections: expected a list of numbers"),
        ("edit", EDIT.replace(b"[0]", b"[true]"), "detections: expected a list of numbers"),
        ("edit", EDIT.replace(b"[0]", b"[-1]"), "detections: expected a list of numbers"),
        ("edit", EDIT.replace(b"[0]", b"[0.5]"), "detections: expected a list of numbers"),
        ("edit", EDIT.replace(b'""', b"1"), "name: expected a text"),
        ("edit", EDIT.replace(b'""', b'"' + b"a" * 201 + b'"'), "name: expected a text"),
        ("edit", EDIT.replace(b"clutter", b"fill"), "kind: expected same or"),
        ("fill", b'{"kind": "same", "track": 0, "first": 1, "last": 2}', "kind: expected fill or"),
        ("undo", b'{"all": true}', "message: expected the fields none, found all"),
        ("save", b'{"path": "/tmp/x.c3d"}', "message: expected the fields none, found path"),
        ("exec", b"{}", "action: expected edit or"),
        ("preview", b'{"track": null, "first": 1, "last": 2}', "track: expected a whole number"),
    ],
)
def test_malformed_messages_are_refused(served, action, body, reason):
    status, text = served.request("POST", f"/do/{action}", body, **served.headers())
    assert status == 400
    assert text.startswith(reason)
    assert "Traceback" not in text
    with pytest.raises(ParameterError):
        parsed(action, body)


@pytest.mark.parametrize("kind", [None, "text/plain", "application/x-www-form-urlencoded"])
def test_forms_are_refused(served, kind):
    headers = served.headers(Content_Type=kind)
    assert served.request("POST", "/do/edit", EDIT, **headers)[0] == 400


def test_only_known_paths_are_answered(served):
    for method, path, status in (
        ("GET", "/do/edit", 405), ("PUT", "/", 405), ("GET", "/../../etc/passwd", 404),
        ("GET", "/events?since=x", 400), ("OPTIONS", "/do/edit", 405),
    ):  # fmt: skip
        assert served.request(method, path, **served.headers())[0] == status, path
    headers = served.headers(X_Asterism_Token=None)
    assert served.request("PUT", f"/?token={served.token}", **headers)[0] == 403


def test_impossible_edits_are_refused_in_words(served):
    for action, message, reason in (
        ("edit", {"kind": "clutter", "detections": [10**9], "name": ""}, "detections: expected"),
        ("edit", {"kind": "same", "detections": [0], "name": ""}, "at: expected 2 detections"),
        ("undo", {}, "undo: expected an edit to undo"),
        ("redo", {}, "redo: expected an edit to redo"),
        ("refuse", {"version": 1, "stretch": 0}, "stretch: expected"),
        ("choose", {"assessment": 7, "decision": 0, "alternative": None}, "decision: expected"),
        ("choose", {"assessment": 0, "decision": 999, "alternative": None}, "decision: expected"),
        ("choose", {"assessment": 0, "decision": 0, "alternative": 99}, "alternative: expected"),
        ("preview", {"track": 9999, "first": 1, "last": 2}, "track: expected"),
        ("fill", {"kind": "fill", "track": 0, "first": 0, "last": 0}, "track: expected a gap"),
        ("preview", {"track": 0, "first": 9999, "last": 9999}, "frame: expected"),
    ):
        status, text = served.post(action, **message)
        assert status == 409, (action, message, text)
        assert text.startswith(reason)
