"""The clients under one interface. An exception reply is raised as Refused."""

import re
import subprocess

from pymodbus import FramerType
from pymodbus.client import ModbusTcpClient

HOST = "127.0.0.1"


class Refused(Exception):
    """An exception reply."""

    def __init__(self, code):
        super().__init__(f"exception {code:02X}")
        self.code = code


class Pymodbus:
    """pymodbus, over Modbus/TCP or with Modbus ASCII frames over TCP."""

    offers = frozenset(
        {
            "most_bits",
            "mask_write",
            "read_write",
            "server_id",
            "diagnostics",
            "identification",
            "exception_status",
            "event_counter",
            "broadcast",
        }
    )

    def __init__(self, port, framer=FramerType.SOCKET):
        self.name = "pymodbus" if framer == FramerType.SOCKET else "pymodbus ascii"
        # One attempt: a second one would hide what went wrong with the first.
        self._client = ModbusTcpClient(HOST, port=port, framer=framer, retries=0, timeout=5)
        if not self._client.connect():
            raise ConnectionError(f"{self.name} cannot connect")

    def close(self):
        self._client.close()

    def _done(self, reply):
        if reply.isError():
            raise Refused(reply.exception_code)
        return reply

    def read_coils(self, unit, address, count):
        return self._done(self._client.read_coils(address, count=count, device_id=unit)).bits[:count]

    def read_discrete_inputs(self, unit, address, count):
        return self._done(self._client.read_discrete_inputs(address, count=count, device_id=unit)).bits[:count]

    def read_holding_registers(self, unit, address, count):
        return self._done(self._client.read_holding_registers(address, count=count, device_id=unit)).registers

    def read_input_registers(self, unit, address, count):
        return self._done(self._client.read_input_registers(address, count=count, device_id=unit)).registers

    def write_coil(self, unit, address, value):
        self._done(self._client.write_coil(address, value, device_id=unit))

    def write_register(self, unit, address, value):
        self._done(self._client.write_register(address, value, device_id=unit))

    def write_coils(self, unit, address, values):
        self._done(self._client.write_coils(address, values, device_id=unit))

    def write_registers(self, unit, address, values):
        self._done(self._client.write_registers(address, values, device_id=unit))

    def mask_write(self, unit, address, and_mask, or_mask):
        request = self._client.mask_write_register
        self._done(request(address=address, and_mask=and_mask, or_mask=or_mask, device_id=unit))

    def read_write(self, unit, read_address, count, write_address, values):
        request = self._client.readwrite_registers
        reply = request(
            read_address=read_address,
            read_count=count,
            write_address=write_address,
            values=values,
            device_id=unit,
        )
        return self._done(reply).registers

    def server_id(self, unit):
        """Without its last byte, which pymodbus takes for the run indicator."""
        return self._done(self._client.report_device_id(device_id=unit)).identifier

    def diagnostics(self, unit, data):
        """Return Query Data."""
        return self._done(self._client.diag_query_data(data, device_id=unit)).message

    def identification(self, unit):
        """The basic objects."""
        reply = self._client.read_device_information(read_code=1, object_id=0, device_id=unit)
        return self._done(reply).information

    def exception_status(self, unit):
        return self._done(self._client.read_exception_status(device_id=unit)).status

    def event_counter(self, unit):
        return self._done(self._client.diag_get_comm_event_counter(device_id=unit)).count

    def broadcast_register(self, address, value):
        self._client.write_register(address, value, device_id=0, no_response_expected=True)


class Mbpoll:
    """mbpoll, which is libmodbus: a process a request."""

    name = "mbpoll"
    offers = frozenset()
    # Its words, which are libmodbus's.
    _CODES = {
        "Illegal function": 0x01,
        "Illegal data address": 0x02,
        "Illegal data value": 0x03,
        "Slave device or server failure": 0x04,
        "Slave device or server is busy": 0x06,
        "Gateway path unavailable": 0x0A,
        "Target device failed to respond": 0x0B,
    }
    _COILS, _DISCRETE_INPUTS, _INPUT_REGISTERS, _HOLDING_REGISTERS = "0", "1", "3:hex", "4:hex"

    def __init__(self, port):
        self._port = str(port)

    def close(self):
        pass

    def _poll(self, kind, unit, address, *more):
        where = ["-m", "tcp", "-p", self._port, "-a", str(unit)]
        what = ["-t", kind, "-0", "-r", str(address), "-1", "-o", "5"]
        command = ["mbpoll", *where, *what, *more]
        done = subprocess.run(command, capture_output=True, text=True, timeout=20)
        output = done.stdout + done.stderr
        failure = re.search(r"failed: (.*)", output)
        if failure and failure[1] in self._CODES:
            raise Refused(self._CODES[failure[1]])
        if failure or done.returncode != 0:
            raise RuntimeError(f"{' '.join(command)}: {output.strip()}")
        return output

    def _read(self, kind, unit, address, count):
        output = self._poll(kind, unit, address, "-c", str(count), HOST)
        found = re.findall(r"^\[(\d+)\]:\s+(\S+)", output, re.MULTILINE)
        if [int(place) for place, _ in found] != list(range(address, address + count)):
            raise RuntimeError(f"mbpoll shows other places than {address} to {address + count - 1}: {output}")
        return [int(value, 0) for _, value in found]

    def _write(self, kind, unit, address, values):
        output = self._poll(kind, unit, address, HOST, *(str(value) for value in values))
        if f"Written {len(values)} references." not in output:
            raise RuntimeError(f"mbpoll did not write {len(values)} values: {output}")

    def read_coils(self, unit, address, count):
        return [bool(value) for value in self._read(self._COILS, unit, address, count)]

    def read_discrete_inputs(self, unit, address, count):
        return [bool(value) for value in self._read(self._DISCRETE_INPUTS, unit, address, count)]

    def read_holding_registers(self, unit, address, count):
        return self._read(self._HOLDING_REGISTERS, unit, address, count)

    def read_input_registers(self, unit, address, count):
        return self._read(self._INPUT_REGISTERS, unit, address, count)

    def write_coil(self, unit, address, value):
        self._write(self._COILS, unit, address, [int(value)])

    def write_register(self, unit, address, value):
        self._write("4", unit, address, [value])

    def write_coils(self, unit, address, values):
        self._write(self._COILS, unit, address, [int(value) for value in values])

    def write_registers(self, unit, address, values):
        self._write("4", unit, address, values)
