#!/usr/bin/env python3
"""The gateway between Modbus and CANopen programs that are not ours; `cargo xtask peers` starts this.

Clients: mbpoll, pymodbus and tokio-modbus. Slaves: pymodbus on an RTU and on an ASCII line, libmodbus on an RTU line, all
on pseudo terminals. What there is of CANopen is in canopen_peers.py. The gateway's ports are named by their default numbers, 8080 and 8502; free ones are taken.
One line a case; the exit code tells whether all passed.
"""

import os
import random
import re
import subprocess
import sys
import tempfile
import threading

from pymodbus import FramerType

import canopen_peers
import cases
import model
from clients import HOST, Mbpoll, Pymodbus
from stage import HERE, Stage, programs

# How many reads each client makes while all others read too.
READS = 40


class Report:
    def __init__(self):
        self.passed = self.failed = 0

    def case(self, name, check):
        try:
            check()
        except Exception as error:
            self.fail(name, f"{type(error).__name__}: {error}")
        else:
            self.passed_case(name)

    def passed_case(self, name):
        self.passed += 1
        print(f"passed  {name}", flush=True)

    def fail(self, name, why):
        self.failed += 1
        print(f"FAILED  {name}: {why}", flush=True)


def start(stage):
    buses = []
    for slave in model.SLAVES:
        near, far = stage.line(f"line-{slave.unit}")
        {"pymodbus": stage.pymodbus, "libmodbus": stage.libmodbus}[slave.name](slave, far)
        buses.append((slave, near))
    return dict(zip(("8080", "8502"), stage.gateway(buses)))


def connections(ports):
    """How every client can be had through every port that speaks its dialect."""
    ways = [(name, kind, port) for name, port in ports.items() for kind in (Mbpoll, Pymodbus)]
    return ways + [("8080", lambda port: Pymodbus(port, FramerType.ASCII), ports["8080"])]


def offered(case, client, slave):
    both = not case.needs or case.needs in client.offers and case.needs in slave.offers
    return both and (not case.client_needs or case.client_needs in client.offers)


def matrix(report, ports):
    for number, (port_name, connect, port) in enumerate(connections(ports)):
        client = connect(port)
        source = random.Random(number)

        def run(case, slave, where):
            if offered(case, client, slave):
                name = f"{client.name} > {port_name} > {where}: {case.name}"
                report.case(name, lambda: case.check(client, slave, source))

        for slave in model.SLAVES:
            for case in cases.CASES:
                run(case, slave, f"{slave.line} > {slave.name}")
        for case in cases.GATEWAY_CASES:
            run(case, model.LIBMODBUS_RTU, "gateway")
        client.close()


def together(report, ports):
    """Every pymodbus connection to every slave at once, each with reads that only it makes."""
    ways = [way for way in connections(ports) if way[1] is not Mbpoll]
    threads = []
    for number, (port_name, connect, port) in enumerate(ways):
        for slave in model.SLAVES:
            client = connect(port)
            name = f"{client.name} > {port_name} > {slave.line} > {slave.name}: {READS} reads beside all others"
            source = random.Random(100 * number + slave.unit)

            def read(client=client, slave=slave, source=source):
                for _ in range(READS):
                    cases.read_input_registers(client, slave, source)
                    cases.read_inputs(client, slave, source)
                client.close()

            threads.append(threading.Thread(target=report.case, args=(name, read)))
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def tokio_modbus(report, ports):
    """tests/tokio_modbus.rs against the same slaves; it prints a line a case."""
    slaves = [f"{name},{HOST}:{port},{s.unit},{s.line} > {s.name}" for name, port in ports.items() for s in model.SLAVES]
    cargo = os.environ.get("CARGO", "cargo")
    done = subprocess.run(
        [cargo, "test", "--quiet", "--test", "tokio_modbus", "--", "--nocapture"],
        cwd=HERE.parent.parent,
        env={**os.environ, "PUENTE_PEERS": "\n".join(slaves)},
        capture_output=True,
        text=True,
    )
    passed = re.findall(r"passed  (tokio-modbus > .*)", done.stdout)
    for name in passed:
        report.passed_case(name)
    if done.returncode != 0 or not passed:
        report.fail("tokio-modbus", f"after {len(passed)} cases: {done.stdout}{done.stderr}")


def main():
    report = Report()
    with tempfile.TemporaryDirectory(prefix="puente-peers-") as folder, Stage(folder, programs()) as stage:
        ports = start(stage)
        matrix(report, ports)
        together(report, ports)
        tokio_modbus(report, ports)
        canopen_peers.run(report, stage)
    print(f"{report.passed} passed, {report.failed} failed")
    return 1 if report.failed else 0


if __name__ == "__main__":
    sys.exit(main())
