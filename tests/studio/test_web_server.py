"""The studio's server: who gets in, and what it does with messages of any kind."""

from __future__ import annotations

import asyncio
import json
import random
import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from hemivar.errors import ProblemError
from hemivar.files.sample import template
from hemivar.studio.binary_message import unpacked
from hemivar.studio.requests import KINDS_OF_REQUEST, MOST_CHARACTERS, read_request
from hemivar.studio.web_server import STATIC, StudioPage, application, bind
from tests.samples import slow

pytest.importorskip(
    "starlette", reason="the studio's server needs starlette: pip install starlette uvicorn websockets tomlkit"
)
pytest.importorskip("httpx2", reason="starlette's test client needs httpx2: pip install httpx2")

if TYPE_CHECKING:
    from starlette.testclient import TestClient

TOKEN, PORT = "0123456789abcdefX", 8123
HOME = f"http://127.0.0.1:{PORT}"


@pytest.fixture
def client() -> TestClient:
    from starlette.testclient import TestClient

    page = StudioPage(template("softening"), Path(), "softening.toml", TOKEN, PORT)
    return TestClient(application(page), base_url=HOME)


def live(client: TestClient, token: str = TOKEN, origin: str | None = HOME) -> object:
    headers = {} if origin is None else {"origin": origin}
    return client.websocket_connect(f"ws://127.0.0.1:{PORT}/{token}/live", headers=headers)


def test_the_page_and_its_parts_come_with_a_strict_policy(client: TestClient) -> None:
    answer = client.get(f"/{TOKEN}/")
    assert answer.status_code == 200
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert answer.headers["referrer-policy"] == "no-referrer"
    for name in re.findall(r'(?:src|href)="([^":]+)"', answer.text):
        assert client.get(f"/{TOKEN}/{name}").status_code == 200, name
    assert "javascript" in client.get(f"/{TOKEN}/main.js").headers["content-type"]


def test_nothing_of_the_page_is_inline_or_from_elsewhere() -> None:
    page = (STATIC / "index.html").read_text(encoding="utf-8")
    assert "<style" not in page
    assert not re.search(r"<script(?![^>]*\bsrc=)", page)
    assert not re.search(r"\son\w+=|style=", page)
    for path in STATIC.glob("*.*"):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", text), path.name
        for found in re.findall(r'from "(\./[^"]+)"', text):
            assert (STATIC / found).exists(), f"{path.name}: {found}"
        if path.suffix == ".js":
            assert len(text.splitlines()) < 500, path.name
            assert "innerHTML" not in text, path.name
    assert {path.name for path in (STATIC / "vendor").iterdir()} == {
        "three.core.min.js", "three.module.min.js", "three.LICENSE",
    }  # fmt: skip


@pytest.mark.parametrize("path", ["", "wrong", "wrong/", "0123456789abcdef/", "0123456789abcdefY/studio.js", "live"])
def test_a_wrong_token_shows_nothing(client: TestClient, path: str) -> None:
    answer = client.get(f"/{path}")
    assert (answer.status_code, answer.text) == (404, "not here\n")


def test_another_host_name_shows_nothing(client: TestClient) -> None:
    """A name of another site that leads to this machine does not make its page one of the studio."""
    assert client.get(f"/{TOKEN}/", headers={"host": f"evil.example:{PORT}"}).status_code == 404
    assert client.get(f"/{TOKEN}/", headers={"origin": "http://evil.example"}).status_code == 404


@pytest.mark.parametrize(
    ("token", "origin"),
    [
        ("wrong", HOME),
        (TOKEN, "http://evil.example"),
        (TOKEN, "null"),
        (TOKEN, None),
        (TOKEN, f"http://127.0.0.1:{PORT + 1}"),
        (TOKEN, f"https://127.0.0.1:{PORT}"),
    ],
)
def test_a_foreign_page_gets_no_socket(client: TestClient, token: str, origin: str | None) -> None:
    from starlette.websockets import WebSocketDisconnect

    with pytest.raises(WebSocketDisconnect), live(client, token, origin):  # type: ignore[attr-defined]
        pass


def until(session: object, *kinds: str) -> dict[str, object]:
    while True:
        head, _ = unpacked(session.receive_bytes())  # type: ignore[attr-defined]
        if head["type"] in kinds:
            return head


def test_a_page_is_greeted_and_answered(client: TestClient) -> None:
    with live(client) as session:  # type: ignore[attr-defined]
        hello = until(session, "hello")
        assert hello["text"] == template("softening")
        assert hello["name"] == "softening.toml"
        session.send_text(json.dumps({"type": "solve", "generation": 3, "text": hello["text"]}))
        assert until(session, "picture")["generation"] == 3
        assert until(session, "certificate")["level"] == "fair"


def test_files_outside_the_page_are_not_served(client: TestClient) -> None:
    for way in ("../web_server.py", "%2e%2e/web_server.py", "..%2fweb_server.py", "vendor/../../jobs.py"):
        assert client.get(f"/{TOKEN}/{way}").status_code in (404, 405), way


def test_a_message_that_is_too_long_ends_the_connection(client: TestClient) -> None:
    from starlette.websockets import WebSocketDisconnect

    with live(client) as session:  # type: ignore[attr-defined]
        until(session, "hello")
        session.send_text("x" * (MOST_CHARACTERS + 1))
        with pytest.raises(WebSocketDisconnect) as ended:
            until(session, "nothing")
        assert ended.value.code == 1009


def test_bytes_end_the_connection(client: TestClient) -> None:
    from starlette.websockets import WebSocketDisconnect

    with live(client) as session:  # type: ignore[attr-defined]
        session.send_bytes(b"\x00")
        with pytest.raises(WebSocketDisconnect) as ended:
            until(session, "nothing")
        assert ended.value.code == 1003


def test_more_pages_than_a_server_takes_are_sent_away(client: TestClient) -> None:
    from contextlib import ExitStack

    from starlette.websockets import WebSocketDisconnect

    with ExitStack() as stack:
        for _ in range(8):
            stack.enter_context(live(client))  # type: ignore[arg-type]
        with live(client) as ninth, pytest.raises(WebSocketDisconnect) as ended:  # type: ignore[attr-defined]
            until(ninth, "hello")
        assert ended.value.code == 1013
        assert "8 pages of this studio are open" in ended.value.reason


def test_a_path_without_a_slash_shows_nothing(client: TestClient) -> None:
    """``OPTIONS *`` has one."""
    sent: list[dict[str, object]] = []

    async def send(message: dict[str, object]) -> None:
        sent.append(message)

    async def receive() -> dict[str, object]:
        return {"type": "http.request", "body": b""}

    page = StudioPage("", Path(), "a", TOKEN, PORT)
    scope = {"type": "http", "method": "OPTIONS", "path": "*", "raw_path": b"*", "query_string": b"", "headers": []}
    asyncio.run(application(page)(scope, receive, send))  # type: ignore[arg-type]
    assert sent[0]["status"] == 404


def random_message(rng: random.Random) -> str:
    """A message that is wrong somehow, or nearly right."""
    values = [None, True, -1, 0, 1.5, 2**80, 1e400, "", "x", [], {}, [1], {"type": "solve"}, "\ud800", "nan"]
    match rng.randrange(4):
        case 0:
            return "".join(chr(rng.randrange(1, 0x300)) for _ in range(rng.randrange(40)))
        case 1:
            return json.dumps(rng.choice(values))
        case 2:
            data = {
                name: rng.choice(values)
                for name in ("type", "generation", "text", "shape", "index", "upper", "other")
                if rng.random() < 0.6
            }
            return json.dumps(data)
    data = {"type": rng.choice(KINDS_OF_REQUEST), "generation": rng.randrange(10), "text": "", "shape": "k", "index": 1}
    data[rng.choice([*data, "upper"])] = rng.choice(values)
    text = json.dumps(data)
    return text if rng.random() < 0.5 else text[: rng.randrange(len(text))]


@pytest.mark.parametrize("count", [1000, slow(10_000)])
def test_thousands_of_random_messages_do_no_harm(count: int, client: TestClient) -> None:
    rng = random.Random(32)
    with live(client) as session:  # type: ignore[attr-defined]
        for _ in range(count):
            session.send_text(random_message(rng).encode("utf-8", "replace").decode())
        # it answers as if nothing had been
        session.send_text(json.dumps({"type": "solve", "generation": 2**53 - 1, "text": template("softening")}))
        assert until(session, "picture")["converged"] is True


def test_random_messages_are_refused_in_a_sentence() -> None:
    rng, refused, words = random.Random(5), 0, set()
    for _ in range(2000):
        try:
            read_request(random_message(rng))
        except ProblemError as error:
            refused += 1
            words.add(str(error))
    assert refused > 1500
    assert not any("\n" in sentence for sentence in words)


@pytest.mark.parametrize("name", ["upper", "low", "high", "generation", "index"])
def test_a_number_of_hundreds_of_digits_is_refused(name: str) -> None:
    with pytest.raises(ProblemError, match=f"{name} must be a"):
        read_request(f'{{"type": "path", "generation": 1, "text": "", "{name}": 1{"0" * 400}}}')


def test_tokens_and_ports_that_make_no_sense_are_refused() -> None:
    for token in ("short", "with/slash/and/more", "0123456789abcdefé"):
        with pytest.raises(ProblemError, match="token"):
            StudioPage("", Path(), "a", token)
    assert StudioPage("", Path()).token != StudioPage("", Path()).token
    with bind(0) as taken:
        assert taken.getsockname()[0] == "127.0.0.1"
        taken.listen()
        with pytest.raises(ProblemError, match="port"):
            bind(taken.getsockname()[1])
