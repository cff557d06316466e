"""The studio's server: one page and its socket, for this machine only."""

from __future__ import annotations

import asyncio
import contextlib
import importlib.util
import secrets
import socket
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote

from hemivar.errors import ProblemError
from hemivar.files.sample import TEMPLATES, template
from hemivar.studio.binary_message import Message
from hemivar.studio.jobs import Bench
from hemivar.studio.page_worker import Desk
from hemivar.studio.requests import MOST_CHARACTERS, read_request
from hemivar.systems import Workspace

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request as HttpRequest
    from starlette.responses import Response
    from starlette.types import ASGIApp, Receive, Scope, Send
    from starlette.types import Message as AsgiMessage
    from starlette.websockets import WebSocket

__all__ = ["STATIC", "StudioPage", "application", "bind", "hello", "refuse_missing", "serve"]

#: Files of the page.
STATIC = Path(__file__).parent / "static"
#: Only this machine reaches the server.
_HOST = "127.0.0.1"
#: Letters of a token: 16 of 64 kinds are 96 bits, which nobody guesses.
_LEAST_TOKEN = 16
#: Pages that may be open at a time: each has a thread.
_MOST_PAGES = 8
#: Nothing is loaded from elsewhere, no script or style stands in the page, no other site may show it.
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS = (
    (b"content-security-policy", _POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cache-control", b"no-store"),
)


@dataclass(frozen=True)
class StudioPage:
    """What a server shows, and who may see it.

    Parameters
    ----------
    text : str
        The problem file with which a page begins.
    folder : Path
        Where meshes and tables that a text names are looked for.
    name : str
        Name of the file for downloads.
    token : str
        Part of the address; who does not know it sees nothing.
    port : int
        Of the server.
    code : tuple of str
        Modules and files whose laws a text may name, as for :func:`hemivar.read_problem`.

    Raises
    ------
    ProblemError
        The token is too short, or holds characters that an address cannot.
    """

    text: str
    folder: Path
    name: str = "problem.toml"
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    port: int = 0
    code: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        plain = all(c.isascii() and (c.isalnum() or c in "-_") for c in self.token)
        if len(self.token) < _LEAST_TOKEN or not plain:
            raise ProblemError(
                f"the token of the studio must have at least {_LEAST_TOKEN} letters, digits, '-' and '_'; leave it out "
                "to get a random one"
            )

    @property
    def address(self) -> str:
        """The address of the page."""
        return f"http://{_HOST}:{self.port}/{self.token}/"


def refuse_missing() -> None:
    """Refuse to start where the server's packages are not installed."""
    absent = [
        name for name in ("starlette", "uvicorn", "websockets", "tomlkit") if importlib.util.find_spec(name) is None
    ]
    if absent:
        raise ProblemError(f"the studio needs {' and '.join(absent)}; run pip install {' '.join(absent)}")


def hello(text: str, name: str) -> Message:
    """The first message to a page: the problem that it begins with, and the templates that there are."""
    texts = {key: {"what": what, "text": template(key)} for key, what in TEMPLATES.items()}
    return Message({"type": "hello", "generation": 0, "text": text, "name": name, "templates": texts})


def application(page: StudioPage) -> Starlette:
    """The server as an ASGI application.

    Parameters
    ----------
    page : StudioPage

    Returns
    -------
    Starlette
    """
    from starlette.applications import Starlette
    from starlette.middleware import Middleware
    from starlette.responses import FileResponse
    from starlette.routing import Mount, Route, WebSocketRoute
    from starlette.staticfiles import StaticFiles

    workspace = Workspace(4)
    open_pages: set[Desk] = set()

    async def index(request: HttpRequest) -> Response:
        return FileResponse(STATIC / "index.html")

    async def live(socket: WebSocket) -> None:
        await socket.accept()  # what is closed before has no reason for the browser
        if len(open_pages) >= _MOST_PAGES:
            await socket.close(1013, f"{_MOST_PAGES} pages of this studio are open, the most it serves; close one")
            return
        await _attend(socket, page, workspace, open_pages)

    routes = [
        Route("/", index),
        WebSocketRoute("/live", live),
        Mount("/", StaticFiles(directory=STATIC)),
    ]
    return Starlette(routes=[Mount(f"/{page.token}", routes=routes)], middleware=[Middleware(_Guard, page=page)])


async def _attend(socket: WebSocket, page: StudioPage, workspace: Workspace, open_pages: set[Desk]) -> None:
    """Answer one page until it goes."""
    loop = asyncio.get_running_loop()
    waiting: asyncio.Queue[Message] = asyncio.Queue()
    newest = 0

    def send(message: Message) -> None:
        with contextlib.suppress(RuntimeError):  # the loop is gone
            loop.call_soon_threadsafe(waiting.put_nowait, message)

    async def forward() -> None:
        while True:
            message = await waiting.get()
            if int(str(message.head["generation"])) >= newest:
                await socket.send_bytes(message.packed())

    desk = Desk(Bench(page.folder, workspace, page.text, page.code), send)
    open_pages.add(desk)
    sender = asyncio.create_task(forward())
    try:
        await socket.send_bytes(hello(page.text, page.name).packed())
        while True:
            received = await socket.receive()
            if received["type"] == "websocket.disconnect":
                return
            text = received.get("text")
            if text is None or len(text) > MOST_CHARACTERS:
                await socket.close(1009 if text else 1003, "too long" if text else "texts only")
                return
            try:
                request = read_request(text)
            except ProblemError as error:
                words = f"the page sent {error}"
                send(Message({"type": "refused", "generation": newest, "message": words}))
                continue
            newest = max(newest, request.generation)
            desk.put(request)
    finally:
        sender.cancel()
        desk.close()
        open_pages.discard(desk)


class _Guard:
    """Lets in who knows the token, from this machine's own address; all others see nothing."""

    def __init__(self, app: ASGIApp, page: StudioPage) -> None:
        self._app, self._page = app, page

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.lower(): value.decode("latin-1") for name, value in scope["headers"]}
        given = unquote(scope["path"]).removeprefix("/").partition("/")[0].encode()  # of OPTIONS the path may be *
        known = secrets.compare_digest(given, self._page.token.encode())
        hosts = {f"{name}:{self._page.port}" for name in (_HOST, "localhost")}
        origin = headers.get(b"origin")
        own = headers.get(b"host") in hosts and (origin is None or origin in {f"http://{host}" for host in hosts})
        if scope["type"] == "websocket":
            if known and own and origin is not None:
                await self._app(scope, receive, send)
            else:
                await send({"type": "websocket.close", "code": 1008, "reason": ""})
            return
        if not (known and own):
            await send({"type": "http.response.start", "status": 404, "headers": [*_HEADERS]})
            await send({"type": "http.response.body", "body": b"not here\n"})
            return

        async def guarded(message: AsgiMessage) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *_HEADERS]
            await send(message)

        await self._app(scope, receive, guarded)


def bind(port: int) -> socket.socket:
    """A socket of this machine alone."""
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((_HOST, port))
        listening.listen(64)  # a browser that is opened at once waits until the server accepts
    except (OSError, OverflowError) as error:
        listening.close()
        reason = getattr(error, "strerror", None) or error
        raise ProblemError(f"port {port}: {reason}; give another one by --port, or none") from None
    return listening


def serve(page: StudioPage, listening: socket.socket, ready: Callable[[], None]) -> None:
    """Serve until interrupted.

    Parameters
    ----------
    page : StudioPage
        With the port of the socket.
    listening : socket
        See :func:`bind`.
    ready : callable
        Called when the server begins.
    """
    import uvicorn

    config = uvicorn.Config(
        application(page), log_level="warning", access_log=False, lifespan="off", ws="websockets-sansio",
        ws_max_size=4 * MOST_CHARACTERS, ws_per_message_deflate=False, timeout_graceful_shutdown=1,
    )  # fmt: skip
    ready()
    uvicorn.Server(config).run(sockets=[listening])
