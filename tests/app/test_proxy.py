"""Behind nginx with the shipped configuration, hostile clients do not prevent answers to other clients.

The faults caught: a limit that refuses a classroom, too few connections, a client that holds a worker by reading
nothing.
"""

import contextlib
import http.client
import json
import os
import resource
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from tests.conftest import started, until

NGINX = shutil.which("nginx", path=f"{os.environ.get('PATH', '')}:/usr/sbin")
CONFIGURATION = (Path(__file__).parents[2] / "deploy" / "nginx.conf").read_text()
HOSTILE, HONEST = 200, 16
SECONDS = 2.5
HEADER_SECONDS = 3
BODY = json.dumps(
    {"rotation": [0, 15, 40], "position": [[0, 0], [40, 8], [75, 30]], "timing": "free", "budget_ms": 50}
)
pytestmark = [
    pytest.mark.fault,
    pytest.mark.skipif(NGINX is None, reason="nginx is not installed (Debian: nginx-light)"),
]


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """The port of nginx in front of the service, both on the loopback interface."""
    folder = tmp_path_factory.mktemp("nginx")
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(8192, hard), hard))
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with started(folder, "-m", "app.start", "serve", "--no-atlas", "--port", "0") as (_, behind, _):
        changes = {"server atlas:8000;": f"server 127.0.0.1:{behind};", "listen 8080 ": f"listen 127.0.0.1:{port} "}
        changes |= {"client_header_timeout 10s;": f"client_header_timeout {HEADER_SECONDS}s;"}
        changes |= {"access_log /dev/stdout;": f"access_log off; {temporary(folder)}"}
        text = CONFIGURATION
        for shipped, tested in changes.items():
            assert text.count(shipped) == 1
            text = text.replace(shipped, tested)
        (folder / "nginx.conf").write_text(text)
        user = "user root; " if os.geteuid() == 0 else ""
        options = f"daemon off; {user}pid {folder}/nginx.pid; error_log {folder}/error.log;"
        command = [str(NGINX), "-p", str(folder), "-c", str(folder / "nginx.conf"), "-e", f"{folder}/start.log"]
        proxy = subprocess.Popen([*command, "-g", options])
        try:
            until(lambda: proxy.poll() is not None or answers(port))
            assert proxy.poll() is None, (folder / "start.log").read_text()
            yield port
        finally:
            proxy.terminate()
            proxy.wait(30)


def temporary(folder: Path) -> str:
    """Directives for folders that every user may write to."""
    names = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    return " ".join(f"{name}_temp_path {folder}/{name};" for name in names)


def answers(port: int) -> bool:
    try:
        return status_of(port, "127.0.0.1", "GET", "/livez") == 200
    except OSError:
        return False


def status_of(port: int, address: str, method: str, path: str, body: str | None = None) -> int:
    """The status of a request from an address of the loopback network."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30, source_address=(address, 0))
    with closing(connection):
        connection.request(method, path, body, {"Content-Type": "application/json"} if body else {})
        reply = connection.getresponse()
        reply.read()
        return reply.status


# -- hostile clients: each has ten connections from an address of its own ---------------------------------------------------


def opened(port: int, k: int) -> socket.socket:
    client = socket.socket()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    client.bind((f"127.0.1.{1 + k // 10}", 0))
    client.connect(("127.0.0.1", port))
    client.setblocking(False)
    return client


def slow_header(client: socket.socket, step: int) -> None:
    client.send(b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Slow: " if step == 0 else b"x")


def slow_body(client: socket.socket, step: int) -> None:
    head = b"POST /v2/match HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: 1000\r\n\r\n{"
    client.send(head if step == 0 else b" ")


def reads_nothing(client: socket.socket, step: int) -> None:
    if step == 0:
        client.send(30 * b"GET /static/examples.json HTTP/1.1\r\nHost: localhost\r\n\r\n")


@pytest.mark.parametrize("hostile", [slow_header, slow_body, reads_nothing])
def test_honest_clients_are_answered_beside_hostile_ones(hostile: Callable, port: int) -> None:
    with ExitStack() as stack:
        sockets = [stack.enter_context(opened(port, k)) for k in range(HOSTILE)]
        end = time.monotonic() + SECONDS

        def honest(k: int) -> list[tuple[int, float]]:
            seen = []
            while time.monotonic() < end:
                for path, body in (("/", None), ("/livez", None), ("/v2/synthesize", BODY)):
                    begin = time.monotonic()
                    status = status_of(port, f"127.0.2.{1 + k}", "POST" if body else "GET", path, body)
                    seen.append((status, time.monotonic() - begin))
            return seen

        with ThreadPoolExecutor(HONEST) as pool:
            running = [pool.submit(honest, k) for k in range(HONEST)]
            for step in range(int(SECONDS / 0.5)):
                for client in sockets:
                    try:
                        hostile(client, step)
                    except OSError:  # nginx has closed it
                        pass
                time.sleep(0.5)
            seen = [row for each in running for row in each.result()]
    assert len(seen) >= 3 * HONEST and {status for status, _ in seen} == {200}
    assert max(seconds for _, seconds in seen) < 10


def test_a_slow_header_is_cut_off(port: int) -> None:
    with opened(port, 0) as client:
        client.settimeout(20)
        begin = time.monotonic()
        slow_header(client, 0)
        with contextlib.suppress(ConnectionResetError):
            assert client.recv(1) == b""
        assert HEADER_SECONDS - 1 < time.monotonic() - begin < 15


def test_a_classroom_behind_one_address_gets_its_pages(port: int) -> None:
    """Thirty browsers load the page with its 45 files and search at the same time."""
    paths = ["/"] + 45 * ["/static/main.js"]
    with ThreadPoolExecutor(30) as pool:
        pages = [pool.submit(status_of, port, "127.0.3.1", "GET", path) for path in 30 * paths]
        searches = [pool.submit(status_of, port, "127.0.3.1", "POST", "/v2/synthesize", BODY) for _ in range(30)]
        assert {future.result() for future in pages + searches} == {200}


def test_one_address_cannot_take_everything(port: int) -> None:
    with ThreadPoolExecutor(40) as pool:
        statuses = list(pool.map(lambda _: status_of(port, "127.0.4.1", "POST", "/v2/nothing", "{}"), range(1500)))
    assert 429 in statuses and set(statuses) <= {404, 429}


def test_errors_of_the_proxy_have_the_form_of_the_service(port: int) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    with closing(connection):
        connection.request("POST", "/v2/match", "x" * 1_000_001, {"Content-Type": "application/json"})
        reply = connection.getresponse()
        assert reply.status == 413 and reply.headers["Content-Type"] == "application/problem+json"
        assert json.loads(reply.read())["status"] == 413
    assert status_of(port, "127.0.0.1", "GET", "/metrics") == 404
