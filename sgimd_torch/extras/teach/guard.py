"""Access to the page: the server answers only requests with a token, which is a part of the page's address.

    with guarded(token): server = viser.ViserServer(host="127.0.0.1", port=port)
Any web page that is open in a browser can send requests to this machine. So each request must have the token, either in
its address or in a cookie, which the first answer sets. Its Host and Origin must be this machine.
"""

from __future__ import annotations

import hmac
import http
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.cookies import CookieError, SimpleCookie
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

import websockets.asyncio.server
from websockets.datastructures import MultipleValuesError
from websockets.http11 import Request, Response

Answer = Callable[[Any, Request], Response | None]
"""Function (connection, request) -> response, None for a request that opens a websocket."""
THIS_MACHINE: Final = ("127.0.0.1", "localhost", "::1")
LONGEST: Final = 200  # largest length of an address; viser looks it up as a file name, which has at most 255 bytes


@contextmanager
def guarded(token: str) -> Iterator[None]:
    """Servers of websockets that start in this block answer only requests with the ``token``.

    Raises:
        RuntimeError: no server was started in the block.
    """
    serve, started = websockets.asyncio.server.serve, []

    def serve_guarded(*arguments: Any, process_request: Answer, **options: Any) -> Any:
        started.append(True)
        return serve(*arguments, process_request=guard(token, process_request), **options)

    websockets.asyncio.server.serve = serve_guarded  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        websockets.asyncio.server.serve = serve  # type: ignore[misc]
    if not started:
        raise RuntimeError("this version of viser starts its server in another way, so nothing would guard the page")


def guard(token: str, answer: Answer) -> Answer:
    """A wrapper of ``answer`` that refuses requests without the token, and requests from pages of other machines."""
    name = f"teach-{hmac.digest(token.encode(), b'cookie', 'sha256').hex()[:8]}"

    def answer_guarded(connection: Any, request: Request) -> Response | None:
        def refused(status: http.HTTPStatus) -> Response:
            refusal: Response = connection.respond(status, f"{status.phrase}\n")
            return refusal

        if len(request.path) > LONGEST:
            return refused(http.HTTPStatus.REQUEST_URI_TOO_LONG)
        try:
            host, origin, cookies = (request.headers.get(header) for header in ("Host", "Origin", "Cookie"))
            is_own = urlsplit(f"//{host}").hostname in THIS_MACHINE and origin in (None, f"http://{host}")
            in_address = parse_qs(urlsplit(request.path).query).get("token", [""])[0]
            cookie = SimpleCookie(cookies).get(name)
        except (ValueError, CookieError, MultipleValuesError):  # no browser sends such headers
            return refused(http.HTTPStatus.FORBIDDEN)
        received = in_address or ("" if cookie is None else cookie.value)
        if not is_own or not hmac.compare_digest(received.encode(), token.encode()):
            return refused(http.HTTPStatus.FORBIDDEN)
        response = answer(connection, request)
        if response is not None and in_address:
            response.headers["Set-Cookie"] = f"{name}={token}; HttpOnly; SameSite=Strict; Path=/"
        return response

    return answer_guarded
