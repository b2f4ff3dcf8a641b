"""The gateway between CANopen programs that are not ours: python canopen as nodes, python-can as clients, tshark as witness.

The nodes and the gateway are on one simulated bus, to which `cell canopen` has doors: node 5 comes by SLCAN, node 6 by
socketcand. Node 9 is the cell's own.
"""

import base64
import json
import random
import re
import socket
import subprocess
import threading
import time
import urllib.error
import urllib.request

import can
import canopen
from canopen.objectdictionary import datatypes

from stage import HERE

HOST = "127.0.0.1"
PATIENCE = 15
EDS = HERE / "device.eds"
SYNC_US = 20_000
# Block transfers each way.
BLOCKS = 20
# Names of CiA 309-3 for the data types of the file.
TYPES = {
    datatypes.UNSIGNED8: "u8",
    datatypes.UNSIGNED16: "u16",
    datatypes.UNSIGNED32: "u32",
    datatypes.INTEGER32: "i32",
    datatypes.REAL32: "r32",
    datatypes.VISIBLE_STRING: "vs",
    datatypes.DOMAIN: "d",
}


def until(what, condition):
    deadline = time.monotonic() + PATIENCE
    while True:
        found = condition()
        if found:
            return found
        if time.monotonic() > deadline:
            raise TimeoutError(what)
        time.sleep(0.02)


def same(found, expected):
    if found != expected:
        raise AssertionError(f"{found!r} instead of {expected!r}")


def free_port():
    with socket.socket() as door:
        door.bind((HOST, 0))
        return door.getsockname()[1]


class Http:
    def __init__(self, port):
        self.root = f"http://{HOST}:{port}/api/buses/can/nodes"

    def __call__(self, path, method="GET", body=None):
        request = urllib.request.Request(self.root + path, data=body, method=method)
        try:
            with urllib.request.urlopen(request, timeout=PATIENCE) as reply:
                return json.load(reply)
        except urllib.error.HTTPError as error:
            return json.load(error)

    def put(self, path, value):
        return self(path, "PUT", json.dumps({"value": value}).encode())


class Ascii:
    """A client in CiA 309-3."""

    def __init__(self, port):
        self.stream = socket.create_connection((HOST, port), timeout=60).makefile("rw", newline="\n")
        self.number = 0
        self.told = []

    def __call__(self, command):
        self.number += 1
        self.stream.write(f"[{self.number}] {command}\n")
        self.stream.flush()
        head = f"[{self.number}] "
        while True:
            line = self.line()
            if line.startswith(head):
                return line[len(head):]
            self.told.append(line)

    def line(self):
        line = self.stream.readline()
        if not line:
            raise ConnectionError("the gateway has closed")
        return line.strip()


class Bench:
    """The bus, the nodes and the gateway."""

    def __init__(self, stage, name, *faults, sync_us=SYNC_US):
        self.pcap = stage.folder / f"{name}.pcap"
        slcan, socketcand = free_port(), free_port()
        command = [stage.programs / "cell", "canopen", "--slcan", f"{HOST}:{slcan}"]
        command += ["--socketcand", f"{HOST}:{socketcand}", "--node", "9=node", "--pcap", self.pcap, *faults]
        stage._ready(f"{name}-cell", command)
        self.hub = {"slcan": slcan, "socketcand": socketcand}
        self.doors = {"slcan": free_port(), "socketcand": free_port()}
        settings = stage.folder / f"{name}.toml"
        nodes = "".join(
            f'[[node]]\nbus = "can"\nid = {node}\noptional = true\nvendor = 0x11\nserial = 0x44\nheartbeat_ms = 200\n'
            for node in (5, 6)
        )
        settings.write_text(
            f'[net]\nport = 0\nmodbus_port = 0\nslcan_port = {self.doors["slcan"]}\nsocketcand_port = {self.doors["socketcand"]}\n'
            f'[[bus]]\nname = "can"\nprotocol = "canopen"\nport = "slcan:tcp:{HOST}:{slcan}"\nsync_us = {sync_us}\n'
            f'client_frames = "write"\n{nodes}'
        )
        line = stage._ready(f"{name}-gateway", [stage.programs / "gateway", "--config", settings])
        self.main = int(re.match(r"ready http://[\d.]+:(\d+) ", line)[1])
        self.http = Http(self.main)

    def bus(self, interface, ports):
        port = ports[interface]
        if interface == "slcan":
            return can.Bus(interface="slcan", channel=f"socket://{HOST}:{port}", bitrate=1_000_000)
        return can.Bus(interface="socketcand", host=HOST, port=port, channel="can0")

    def node(self, stage, node, interface):
        network = canopen.Network(self.bus(interface, self.hub))
        network.connect()
        stage.callback(network.disconnect)
        local = network.create_node(node, str(EDS))
        local.nmt.state = "PRE-OPERATIONAL"
        local.nmt.send_command(0)
        return local


def boots(bench, node):
    local = bench.http(f"/{node}")
    until("it boots", lambda: bench.http(f"/{node}")["health"] == "booted")
    until("it is started", lambda: bench.http(f"/{node}")["state"] == "operational")
    return local


def expedited(bench, node):
    path = f"/{node}/objects"
    same(bench.http(f"{path}/2000:0/u16")["value"], 4660)
    same(bench.http(f"{path}/2001:0/i32")["value"], -5)
    same(bench.http(f"{path}/2002:0/r32")["value"], 0.5)
    for value in (0, 1, 0xFFFF):
        bench.http.put(f"{path}/2000:0/u16", value)
        same(bench.http(f"{path}/2000:0/u16")["value"], value)
    same(Ascii(bench.main)(f"1 {node} read 0x1018 1 x32"), "0x00000011")


def segmented(bench, node):
    name = "A name that takes more than one segment of an SDO"
    same(bench.http(f"/{node}/objects/1008:0/vs")["value"], name)
    ascii = Ascii(bench.main)
    source = random.Random(node)
    for length in (1, 4, 5, 7, 8, 889, 1024):
        text = base64.b64encode(source.randbytes(length)).decode()
        same(ascii(f"1 {node} write 0x2003 0 d {text}"), "OK")
        same(ascii(f"1 {node} read 0x2003 0 d"), text)


def aborts(bench, node, local):
    path = f"/{node}/objects"
    for address, code in (("3000:0", "06020000"), ("1018:9", "06090011"), ("2004:0", "06010001")):
        same(bench.http(f"{path}/{address}/u8")["error"].get("abort"), code)
    same(bench.http.put(f"{path}/1000:0/u32", 1)["error"].get("abort"), "06010002")
    same(bench.http(f"/77/objects/1000:0")["error"]["code"], "no-reply")


def nmt(bench, node, local):
    for command, state in (("stop", "STOPPED"), ("preop", "PRE-OPERATIONAL"), ("start", "OPERATIONAL")):
        bench.http(f"/{node}/{command}", "POST")
        until(command, lambda: local.nmt.state == state)
        until(f"{command} is seen", lambda: bench.http(f"/{node}")["state"] == state.lower())


def heartbeat(bench, node, local):
    same(local.sdo[0x1017].raw, 200)
    local.nmt.stop_heartbeat()
    until("it is lost", lambda: bench.http(f"/{node}")["health"] == "lost")
    local.nmt.start_heartbeat(200)
    until("it is back", lambda: bench.http(f"/{node}")["health"] == "booted")


def emergencies(bench, node, local):
    local.emcy.send(0x2310, 0x03, b"\x01\x02\x03\x04\x05")
    told = until("it is told", lambda: bench.http(f"/{node}/emergencies"))[-1]["emergency"]
    same((told["code"], told["register"], told["vendor"]), ("2310", "03", "0102030405"))
    same(bench.http(f"/{node}")["emergency"]["code"], "2310")
    local.emcy.reset()
    until("it is over", lambda: bench.http(f"/{node}")["emergency"] is None)


def pdo(bench, node, local):
    client = Ascii(bench.main)
    same(client("1 set events pdo 1"), "OK")
    local.tpdo.read(from_od=True)
    local.tpdo[1].cob_id = 0x180 + node
    local.tpdo[1].clear()
    local.tpdo[1].add_variable(0x2000)
    local.tpdo[1]["Word"].raw = 0xBEEF
    local.tpdo[1].enabled = True
    local.tpdo[1].transmit()
    while True:
        line = client.line()
        if line == f"1 {node} PDO 1 EF BE":
            return


def sync(bench, bus):
    """SYNC keeps its period: of the frames that came, by the time stamps of the first and the last."""
    times = []
    while len(times) < 100:
        frame = bus.recv(PATIENCE)
        if frame is None:
            raise TimeoutError("SYNC")
        if frame.arbitration_id == 0x80:
            same(frame.dlc, 0)
            times.append(time.monotonic())
    mean = (times[-1] - times[0]) / (len(times) - 1) * 1e6
    if not 0.9 * SYNC_US < mean < 1.1 * SYNC_US:
        raise AssertionError(f"a SYNC each {mean:.0f} us")


def sheet(bench, node):
    """Names, types, access and limits of every object, as canopen's own parser has them."""
    kept = bench.http(f"/{node}/eds", "PUT", EDS.read_bytes())
    same(kept["left_out"], 0)
    listed = {(int(o["index"], 16), o["sub"]): o for o in bench.http(f"/{node}/objects")}
    dictionary = canopen.import_od(str(EDS), node)
    checked = 0
    for entry in dictionary.values():
        alone = isinstance(entry, canopen.objectdictionary.ODVariable)
        for variable in [entry] if alone else entry.values():
            found = listed.get((variable.index, variable.subindex))
            if found is None or variable.index == 0x2005:
                found = bench.http(f"/{node}/objects/{variable.index:04X}:{variable.subindex}")
                if "type" not in found:
                    continue
            same(found["type"], TYPES[variable.data_type])
            if variable.index == 0x2005:
                continue
            same(found["name"], variable.name)
            same(found["object"], None if alone else entry.name)
            same(found["access"], variable.access_type)
            same((found["low"], found["high"]), (variable.min, variable.max))
            if isinstance(variable.default, int):
                same(found["default"], variable.default)
            checked += 1
    if checked < 20:
        raise AssertionError(f"only {checked} objects were compared")
    same(bench.http(f"/{node}/objects/2001:0")["value"], -5)


def clients(bench, interface):
    """python canopen as a master of its own, through a door of the gateway, to a node that the gateway leaves alone."""
    network = canopen.Network(bench.bus(interface, bench.doors))
    network.connect()
    remote = network.add_node(7, str(EDS))
    remote.sdo.RESPONSE_TIMEOUT = 3
    same(remote.sdo["Identity object"]["Vendor-ID"].raw, 0x11)
    remote.sdo["Signed"].raw = 77
    network.disconnect()
    same(bench.http("/7/objects/2001:0/i32")["value"], 77)


def blocks(bench):
    """Block transfers both ways while frames are lost. One whose first or last message is lost is given up: then it is told."""
    until("the bus is up", lambda: "value" in bench.http("/9/objects/1000:0"))
    client = Ascii(bench.main)
    same(client("1 set sdo_block 1"), "OK")
    source = random.Random(1)
    given_up = 0

    def ask(command):
        nonlocal given_up
        while True:
            answer = client(command)
            if not re.match(r"(.*\.\.\.)?ERROR:0x05040", answer):
                return answer
            given_up += 1

    for _ in range(BLOCKS):
        text = base64.b64encode(source.randbytes(1024)).decode()
        same(ask(f"1 9 write 0x2000 0 d {text}"), "OK")
        same(ask("1 9 read 0x2000 0 d"), text)
    if given_up > BLOCKS:
        raise AssertionError(f"{given_up} of {2 * BLOCKS} transfers were given up")


def decoded(bench):
    """What was on the bus, as tshark has it: no malformed frame."""
    tshark = ["tshark", "-r", bench.pcap, "-d", "can.subdissector=canopen"]
    # The capture goes on: that its last packet is cut short is no mistake.
    run = lambda *more: subprocess.run([*tshark, *more], capture_output=True, text=True).stdout
    bad = run("-Y", "_ws.malformed || _ws.expert.severity == error").splitlines()
    same(bad[:3], [])
    kinds = run("-Y", "canopen", "-T", "fields", "-e", "_ws.col.Info")
    for kind in ("SDO", "SYNC", "NMT", "EMCY"):
        if kind not in kinds:
            raise AssertionError(f"no {kind} among {len(kinds.splitlines())} frames")


def run(report, stage):
    bench = Bench(stage, "can")
    other = bench.node(stage, 7, "slcan")
    for interface in ("slcan", "socketcand"):
        report.case(f"python canopen > gateway's {interface}: SDO", lambda: clients(bench, interface))
    other.network.disconnect()
    for node, interface in ((5, "slcan"), (6, "socketcand")):
        local = bench.node(stage, node, interface)
        name = f"python canopen by {interface}"
        report.case(f"{name}: boots, with its identity", lambda: boots(bench, node))
        report.case(f"{name}: expedited transfers", lambda: expedited(bench, node))
        report.case(f"{name}: segmented transfers", lambda: segmented(bench, node))
        report.case(f"{name}: abort codes", lambda: aborts(bench, node, local))
        report.case(f"{name}: NMT", lambda: nmt(bench, node, local))
        report.case(f"{name}: heartbeat", lambda: heartbeat(bench, node, local))
        report.case(f"{name}: emergencies", lambda: emergencies(bench, node, local))
        report.case(f"{name}: PDO", lambda: pdo(bench, node, local))
        with bench.bus(interface, bench.hub) as listener:
            report.case(f"{name}: SYNC", lambda: sync(bench, listener))
        report.case(f"{name}: data sheet", lambda: sheet(bench, node))
    report.case("tshark: all frames are CANopen", lambda: decoded(bench))
    lossy = Bench(stage, "lossy", "--drop", "1%", sync_us=0)
    report.case("block transfers, 1 % of all frames lost", lambda: blocks(lossy))
