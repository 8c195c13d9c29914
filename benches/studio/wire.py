#!/usr/bin/env python3
"""Bars of the mesh workspace over the WebSocket: the program as it is shipped, CPU time of its process, p95.

    benches/studio/wire.py target/release/plumbline MESH.obj

Starts `plumbline studio`, opens the mesh, makes handles by half-spaces, drags one as a page does (the next edit when the last one is
answered), rests, undoes all drags, saves, and compares with `plumbline run`. Standard library only.
"""

import base64
import http.client
import json
import os
import re
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import time

DRAGS = 200
POSITIONS = 101


def cpu_ms(pid):
    """User and system time of a process, in ms. The kernel counts in ticks of 10 ms: single updates are means."""
    fields = open(f"/proc/{pid}/stat").read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) * 1000.0 / os.sysconf("SC_CLK_TCK")


def resident_mb(pid):
    return int(re.search(r"VmRSS:\s+(\d+)", open(f"/proc/{pid}/status").read()).group(1)) / 1e3


class Socket:
    """A WebSocket client: text out, text and binary in."""

    def __init__(self, port, path, protocols):
        self.stream = socket.create_connection(("127.0.0.1", port))
        key = base64.b64encode(os.urandom(16)).decode()
        self.stream.sendall(
            f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
            f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
            f"Sec-WebSocket-Protocol: {', '.join(protocols)}\r\n\r\n".encode()
        )
        self.buffer = b""
        head = self._until(b"\r\n\r\n")
        if b" 101 " not in head.split(b"\r\n")[0]:
            raise SystemExit(f"the server refused the socket: {head.decode(errors='replace')}")

    def _until(self, end):
        while end not in self.buffer:
            self.buffer += self.stream.recv(1 << 16)
        head, self.buffer = self.buffer.split(end, 1)
        return head

    def _exactly(self, count):
        while len(self.buffer) < count:
            chunk = self.stream.recv(1 << 20)
            if not chunk:
                raise SystemExit("the server closed the socket")
            self.buffer += chunk
        found, self.buffer = self.buffer[:count], self.buffer[count:]
        return found

    def send(self, message):
        payload, mask = json.dumps(message).encode(), os.urandom(4)
        length = len(payload)
        size = bytes([0x80 | length]) if length < 126 else struct.pack(">BH", 0xFE, length) if length < 1 << 16 else struct.pack(">BQ", 0xFF, length)
        self.stream.sendall(b"\x81" + size + mask + bytes(b ^ mask[i % 4] for i, b in enumerate(payload)))

    def receive(self):
        """The next message: a value, or (kind, edit, payload)."""
        while True:
            first, second = self._exactly(2)
            length = second & 127
            if length == 126:
                length = struct.unpack(">H", self._exactly(2))[0]
            elif length == 127:
                length = struct.unpack(">Q", self._exactly(8))[0]
            payload = self._exactly(length)
            if first & 15 == 1:
                return json.loads(payload)
            if first & 15 == 2:
                kind, _item, edit, _size = struct.unpack("<4I", payload[:16])
                return (kind, edit, payload[16:])
            if first & 15 == 8:
                raise SystemExit("the server closed the socket")


class Studio:
    def __init__(self, program, folder, mesh):
        self.folder, self.number = folder, 0
        self.process = subprocess.Popen([program, "studio", folder, "--no-open"], stdout=subprocess.PIPE, text=True,
                                        env={**os.environ, "HOME": folder, "XDG_STATE_HOME": folder})
        url = next(m for m in (re.search(r"127\.0\.0\.1:(\d+)/\S*#token=(\w+)", line) for line in self.process.stdout) if m)
        self.port = int(url.group(1))
        self.session = self.post("/api/session", {"token": url.group(2)})["session"]
        self.started = (cpu_ms(self.process.pid), time.monotonic())
        document = self.post("/api/open", {"path": mesh})["document"]
        self.socket = Socket(self.port, f"/ws?document={document}", ["plumbline", f"token.{self.session}"])
        self.state, self.working, self.notices = None, False, []

    def post(self, path, body):
        connection = http.client.HTTPConnection("127.0.0.1", self.port)
        headers = {"content-type": "application/json", "origin": f"http://127.0.0.1:{self.port}"}
        if path != "/api/session":
            headers["x-plumbline-session"] = self.session
        connection.request("POST", path, json.dumps(body), headers)
        answer = connection.getresponse()
        text = answer.read().decode()
        if answer.status != 200:
            raise SystemExit(f"{path}: {answer.status} {text}")
        return json.loads(text)

    def hear(self):
        message = self.socket.receive()
        if isinstance(message, dict):
            self.state = message.get("state", self.state)
            self.working = message.get("working", self.working)
            if "notice" in message:
                self.notices.append(message["notice"]["text"])
        return message

    def until(self, test):
        while True:
            message = self.hear()
            if test(message):
                return message

    def call(self, message):
        """Sends a message and waits for its reply."""
        self.number += 1
        number = self.number
        self.socket.send({"id": number, **message})
        reply = self.until(lambda m: isinstance(m, dict) and m.get("reply") == number)
        if reply.get("error"):
            raise SystemExit(f"{message}: {reply['error']}")
        return reply

    def rest(self):
        while self.state is None or self.state["solve"]["phase"] != "rest":
            self.hear()


def p95(values):
    return sorted(values)[min(len(values) - 1, len(values) * 95 // 100)]


def points(path):
    return [tuple(map(float, line.split()[1:4])) for line in open(path) if line.startswith("v ")]


def drags(studio, low, high):
    """A hand that drags: CPU per picture (a mean), and milliseconds from the edit to its picture (p95)."""
    size, times, began = high - low, [], cpu_ms(studio.process.pid)
    for step in range(1, DRAGS + 1):
        started = time.monotonic()
        studio.number += 1
        studio.socket.send({"id": studio.number, "newest": True, "edit": {
            "do": "drag", "handle": 1, "gesture": step, "time": 1.0, "scale": [1, 1, 1], "rotation": [1, 0, 0.002, 0],
            "translation": [0.006 * size, 0.002 * size, 0.0]}})
        number = studio.number
        studio.until(lambda m: isinstance(m, tuple) and m[0] == POSITIONS and m[1] >= number)
        times.append(1e3 * (time.monotonic() - started))
    studio.call({"seal": True})
    return (cpu_ms(studio.process.pid) - began) / DRAGS, p95(times)


def main():
    program, mesh = os.path.abspath(sys.argv[1]), sys.argv[2]
    folder = tempfile.mkdtemp(prefix="studio-bars-")
    try:
        path = shutil.copy(mesh, folder)
        studio = Studio(program, folder, path)
        pid = studio.process.pid
        studio.until(lambda m: isinstance(m, tuple) and m[0] == POSITIONS)
        print(f"{studio.state['mesh']['vertices']} vertices")
        print(f"opening to the first picture      {cpu_ms(pid) - studio.started[0]:8.0f} ms CPU {1e3 * (time.monotonic() - studio.started[1]):8.0f} ms")
        heights = [p[1] for p in points(path)]
        low, high = min(heights), max(heights)
        edit = lambda **fields: studio.call({"edit": fields})
        edit(do="select_half_space", point=[0, low + (high - low) / 6, 0], normal=[0, -1, 0])
        edit(do="add_handle", kind="fixed")
        studio.rest()
        edit(do="select_half_space", point=[0, low + (high - low) * 11 / 12, 0], normal=[0, 1, 0])
        edit(do="add_handle", kind="rigid")
        cpu, latency = drags(studio, low, high)
        print(f"drag: per update                  {cpu:8.1f} ms CPU {latency:8.1f} ms p95 from edit to picture")
        started = time.monotonic()
        studio.rest()
        print(f"to rest after the last drag       {1e3 * (time.monotonic() - started):8.0f} ms, energy {studio.state['solve']['energy']:.6g}")
        studio.call({"save": True})
        download = studio.call({"ask": {"ask": "export", "format": "obj"}})["download"]
        connection = http.client.HTTPConnection("127.0.0.1", studio.port)
        connection.request("GET", download["url"])
        shown = os.path.join(folder, "shown.obj")
        open(shown, "wb").write(connection.getresponse().read())
        name = os.path.splitext(os.path.basename(path))[0]
        subprocess.run([program, "run", f"{name}.deform.toml"], cwd=folder, check=True, capture_output=True)
        pairs = zip(points(shown), points(os.path.join(folder, f"{name}-deformed.obj")), strict=True)
        apart = max(sum((a - b) ** 2 for a, b in zip(p, q)) ** 0.5 for p, q in pairs)
        print(f"shown / plumbline run             {apart / studio.state['mesh']['diagonal']:8.1e} of the diagonal")
        began = cpu_ms(pid)
        for _ in range(DRAGS):
            studio.call({"undo": True})
        print(f"undo                              {(cpu_ms(pid) - began) / DRAGS:8.1f} ms CPU, with what is drawn between")
        studio.rest()
        print(f"memory, idle                      {resident_mb(pid):8.0f} MB")
        studio.process.terminate()
    finally:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
