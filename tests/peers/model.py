"""What every slave under test holds, and who can do what."""

from dataclasses import dataclass

COILS = 2000
DISCRETE_INPUTS = 2000
HOLDING_REGISTERS = 300
INPUT_REGISTERS = 300
# No slave has anything here.
NOWHERE = 5000

# Most that one request may carry: MODBUS Application Protocol V1.1b3, clauses 6.1 to 6.17.
MOST_READ_BITS, MOST_WRITTEN_BITS = 2000, 1968
MOST_READ_REGISTERS, MOST_WRITTEN_REGISTERS = 125, 123
MOST_READ_WRITE = 121


def coil(address):
    """Before anybody has written it."""
    return address % 3 == 0


def discrete_input(address):
    return address * address % 7 < 3


def input_register(address):
    return (address * 1021 + 7) & 0xFFFF


@dataclass(frozen=True)
class Slave:
    """A slave behind the gateway."""

    name: str
    unit: int
    line: str
    # Functions beyond the data ones, see Client in clients.py.
    offers: frozenset
    # The data of its reply to Report Server ID, without the byte count.
    server_id: bytes


IDENTITY = {0: b"puente", 1: b"peer", 2: b"1.0"}

_MORE = frozenset({"server_id", "diagnostics", "identification", "exception_status", "event_counter"})

PYMODBUS_RTU = Slave("pymodbus", 1, "rtu", _MORE, b"puente-peer-1.0\xff")
PYMODBUS_ASCII = Slave("pymodbus", 2, "ascii", _MORE, b"puente-peer-1.0\xff")
# It knows no function 07, 08, 0B and 2B, and takes no frame of theirs for one.
LIBMODBUS_RTU = Slave("libmodbus", 3, "rtu", frozenset({"server_id"}), b"\xb4\xffLMB3.1.6")
SLAVES = [PYMODBUS_RTU, PYMODBUS_ASCII, LIBMODBUS_RTU]

# On the line of libmodbus, which is silent when another unit is addressed.
SILENT_UNIT = 9
UNMAPPED_UNIT = 200
