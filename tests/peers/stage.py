"""The programs of a run: lines, slaves and the gateway."""

import contextlib
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import model

HERE = Path(__file__).parent
PATIENCE = 10


class Stage(contextlib.ExitStack):
    """Starts programs in a folder of their own; ends them with itself."""

    def __init__(self, folder, programs):
        super().__init__()
        self.folder = Path(folder)
        self.programs = Path(programs)

    def _start(self, name, command, **keywords):
        log = self.enter_context(open(self.folder / f"{name}.log", "w"))
        program = subprocess.Popen(command, stderr=log, text=True, **keywords)
        self.callback(program.wait)
        self.callback(program.kill)
        return program

    def _ready(self, name, command):
        """Starts a program and returns its first line, which begins with 'ready'."""
        program = self._start(name, command, stdout=subprocess.PIPE)
        self.callback(program.stdout.close)
        line = program.stdout.readline()
        if not line.startswith("ready"):
            log = (self.folder / f"{name}.log").read_text()
            raise RuntimeError(f"{name} did not get ready: {line}{log}")
        return line

    def line(self, name):
        """A pair of pseudo terminals: the paths of the gateway's end and the slave's."""
        ends = [self.folder / f"{name}-{end}" for end in ("gateway", "slave")]
        self._start(f"{name}-socat", ["socat", *(f"pty,raw,echo=0,link={end}" for end in ends)])
        deadline = time.monotonic() + PATIENCE
        while not all(end.exists() for end in ends):
            if time.monotonic() > deadline:
                raise RuntimeError(f"socat made no {ends}")
            time.sleep(0.01)
        return ends

    def pymodbus(self, slave, device):
        script = HERE / "slave_pymodbus.py"
        self._ready(f"unit-{slave.unit}", [sys.executable, script, device, slave.line, str(slave.unit)])

    def libmodbus(self, slave, device):
        program = self.folder / "slave_libmodbus"
        flags = subprocess.run(
            ["pkg-config", "--cflags", "--libs", "libmodbus"], check=True, capture_output=True, text=True
        ).stdout.split()
        source = HERE / "slave_libmodbus.c"
        subprocess.run(["gcc", "-Wall", "-Wextra", "-Werror", "-O1", "-o", program, source, *flags], check=True)
        self._ready(f"unit-{slave.unit}", [program, device, str(slave.unit)])

    def gateway(self, buses):
        """Starts the gateway on (slave, device) pairs and returns its two TCP ports, main and Modbus/TCP."""
        text = "[net]\nport = 0\nmodbus_port = 0\n"
        for slave, device in buses:
            units = f"{slave.unit},{model.SILENT_UNIT}" if slave is model.LIBMODBUS_RTU else slave.unit
            text += (
                f'[[bus]]\nname = "{slave.name}-{slave.line}"\nprotocol = "modbus-{slave.line}"\n'
                f'port = "{device}"\nbaud = 115200\nformat = "8E1"\nunits = "{units}"\n'
            )
        settings = self.folder / "gateway.toml"
        settings.write_text(text)
        line = self._ready("gateway", [self.programs / "gateway", "--config", settings])
        main, modbus = re.fullmatch(r"ready http://[\d.]+:(\d+) modbus-tcp://[\d.]+:(\d+)\n", line).groups()
        return int(main), int(modbus)


def programs():
    """Where the built programs are."""
    folder = os.environ.get("PUENTE_BIN")
    if folder is None:
        raise SystemExit("run `cargo xtask peers`, or set PUENTE_BIN to the folder of the built programs")
    return folder
