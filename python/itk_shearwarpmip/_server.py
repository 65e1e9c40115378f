"""The viewer's page, by default for this computer only, and protected by a token."""

import asyncio
import base64
import contextlib
import hashlib
import secrets
import socket
import tempfile
import threading
import webbrowser
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

try:
    import uvicorn
    from rendercanvas import http
except ImportError as error:
    raise ImportError("the viewer's page needs uvicorn: install the wheel with its extra [viewer]") from error

from itk_shearwarpmip._canvas import AtOnce

if TYPE_CHECKING:
    from itk_shearwarpmip._viewer import Viewer

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="dark">
<link rel="icon" href="data:,">
<title>Maximum intensity projection</title>
<link rel="stylesheet" href="renderview.css">
<script type="module" src="renderview.js"></script>
<script type="module" src="viewer.js"></script>
<script type="module" src="renderview-client.js"></script>
<style>
  html, body { height: 100%; margin: 0; overflow: hidden; background: #000; }
  #canvas.renderview-wrapper { display: block; width: 100%; height: 100%; border: 0; }
  #status { display: none; }
  #note {
    position: fixed; bottom: 15%; left: 50%; max-width: 80%; padding: 8px 16px; transform: translateX(-50%);
    border: 1px solid #2a2f36; border-radius: 8px; background: #14171b; color: #d5dae0;
    font: 14px/1.45 system-ui, sans-serif; pointer-events: none;
  }
</style>
</head>
<body>
<div id="canvas" class="renderview-wrapper" style="width: 100vw; height: 100vh"></div>
<div id="status"></div>
<p id="note" role="status" hidden></p>
</body>
</html>
"""

_RESOURCES = {
    **http.resources,
    "index.html": ("text/html; charset=utf-8", _PAGE),
    "viewer.js": ("text/javascript", files(__package__).joinpath("_viewer.js").read_text("utf-8")),
}

# of the button that rendercanvas offers to connect again
_HANDLER = base64.b64encode(hashlib.sha256(b"openWebsocketConnection()").digest())

_HEADERS = [
    (b"cache-control", b"no-store"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
    (
        b"content-security-policy",
        b"default-src 'none'; script-src 'self' 'unsafe-hashes' 'sha256-" + _HANDLER + b"'; "
        b"style-src 'self' 'unsafe-inline'; img-src blob: data:; connect-src 'self'; frame-ancestors 'none'",
    ),
]

_shown: "list[Viewer]" = []


class _Canvas(AtOnce, http.RenderCanvas):  # type: ignore[misc]
    def _rc_close(self) -> None:
        """Does not close the clients, because they may belong to a later canvas; the server closes them."""
        self._is_closed = True

    def send(self, message: dict[str, str]) -> None:
        http.asgi.send_all(message)

    def _maybe_draw(self) -> None:
        """Also sends a frame for which the only client was not ready, such as the picture without loss."""
        super()._maybe_draw()
        self._send_last_frame_to_ready_clients()


class Gate:
    """An ASGI application before another one. It accepts only requests with the token as the first part of their path,
    and no requests from another origin."""

    def __init__(self, application: Any, token: str) -> None:
        self._application = application
        self._token = token

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] == "lifespan":
            await self._application(scope, receive, send)
            return
        problem = self._find_problem(scope)
        if problem is None:

            async def send_with_headers(message: Any) -> None:
                if message["type"] == "http.response.start":
                    message = {**message, "headers": [*message["headers"], *_HEADERS]}
                await send(message)

            await self._application(scope, receive, send_with_headers)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008, "reason": problem})
        else:
            headers = [(b"content-type", b"text/plain; charset=utf-8"), *_HEADERS]
            await send({"type": "http.response.start", "status": 403, "headers": headers})
            await send({"type": "http.response.body", "body": f"{problem}\n".encode()})

    def _find_problem(self, scope: Any) -> str | None:
        headers = {name.lower(): value for name, value in scope["headers"]}
        host, origin = headers.get(b"host", b""), headers.get(b"origin")
        if origin is not None and origin not in (b"http://" + host, b"https://" + host):
            return "The request comes from another page."
        parts = scope["path"].encode().split(b"/")
        if len(parts) != 3 or not secrets.compare_digest(parts[1], self._token.encode()):
            return "The token is missing or wrong. Open the address that the viewer has printed."
        return None


def serve(
    make_viewer: "Callable[[Any], Viewer]",
    *,
    block: bool,
    host: str = "127.0.0.1",
    port: int = 0,
    no_browser: bool = False,
) -> "Viewer":
    """Shows a viewer in the browser, one at a time in a process. Raises RuntimeError if there is one already, and
    OSError if the page cannot be served."""
    if _shown:
        raise RuntimeError(f"this process shows {_shown[0]!r} already: close() that first")
    token = secrets.token_urlsafe(32)
    http.asgi._resources = _RESOURCES
    config = uvicorn.Config(
        Gate(http.asgi, token),
        log_level="warning",
        access_log=False,
        timeout_graceful_shutdown=2,
        # pictures are compressed already
        ws_per_message_deflate=False,
    )
    server = uvicorn.Server(config)
    try:
        listener = socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except (OSError, OverflowError, TypeError) as error:
        raise OSError(f"the page cannot be served at {host}, port {port}: {error}") from error
    viewer = make_viewer(_Canvas())
    _shown.append(viewer)
    shown = {"0.0.0.0": "127.0.0.1", "": "127.0.0.1", "::": "[::1]"}.get(host, f"[{host}]" if ":" in host else host)
    viewer.url = f"http://{shown}:{listener.getsockname()[1]}/{token}/"

    async def run() -> None:
        try:
            await server.serve([listener])
            viewer.canvas.close()
            http.loop.stop(force=True)
        finally:
            viewer.close()

    # signals stay with the main thread
    thread = threading.Thread(target=lambda: asyncio.run(run()), name="viewer's page", daemon=True)

    # the arguments of a process can be seen by other users of the computer, such a file cannot
    folder = tempfile.TemporaryDirectory(prefix="shear-warp-mip-")

    def end() -> None:
        server.should_exit = True
        folder.cleanup()
        if threading.current_thread() is not thread:
            thread.join(5)
        _shown.clear()

    viewer._end = end
    thread.start()
    print(f"{'Ctrl-C ends the viewer. ' if block else ''}The picture is at {viewer.url}", flush=True)
    if not no_browser:
        page = Path(folder.name, "viewer.html")
        page.write_text(f'<meta http-equiv="refresh" content="0; url={viewer.url}">\n')
        webbrowser.open(page.as_uri())
    if block:
        with contextlib.suppress(KeyboardInterrupt):
            thread.join()
        viewer.close()
    return viewer
