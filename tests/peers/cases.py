"""What is exchanged. A case takes a client, a slave and a source of random values, and raises where anything differs."""

from dataclasses import dataclass
from typing import Callable

import model
from clients import Refused


@dataclass(frozen=True)
class Case:
    name: str
    check: Callable
    # What client and slave must both offer.
    needs: str = ""
    # What the client must offer.
    client_needs: str = ""


def same(received, expected):
    if received != expected:
        raise AssertionError(f"received {received} instead of {expected}")


def refused(code, request):
    try:
        received = request()
    except Refused as refusal:
        same(f"exception {refusal.code:02X}", f"exception {code:02X}")
    else:
        raise AssertionError(f"received {received} instead of exception {code:02X}")


def words(random, count):
    return [random.randrange(0x10000) for _ in range(count)]


def bits(random, count):
    return [bool(random.getrandbits(1)) for _ in range(count)]


def read_inputs(client, slave, random):
    address = random.randrange(100)
    expected = [model.discrete_input(address + i) for i in range(19)]
    same(client.read_discrete_inputs(slave.unit, address, 19), expected)


def read_input_registers(client, slave, random):
    address = random.randrange(100)
    expected = [model.input_register(address + i) for i in range(9)]
    same(client.read_input_registers(slave.unit, address, 9), expected)


def write_coil(client, slave, random):
    address = random.randrange(100)
    for value in (True, False, True):
        client.write_coil(slave.unit, address, value)
        same(client.read_coils(slave.unit, address, 1), [value])


def write_coils(client, slave, random):
    # Across the borders of bytes on both sides.
    values = bits(random, 37)
    client.write_coils(slave.unit, 203, values)
    same(client.read_coils(slave.unit, 203, 37), values)


def write_register(client, slave, random):
    for value in (0x0000, 0x8001, 0xFFFF, random.randrange(0x10000)):
        client.write_register(slave.unit, 17, value)
        same(client.read_holding_registers(slave.unit, 17, 1), [value])


def write_registers(client, slave, random):
    values = words(random, 10)
    client.write_registers(slave.unit, 40, values)
    same(client.read_holding_registers(slave.unit, 40, 10), values)


def most_registers(client, slave, random):
    values = words(random, model.MOST_WRITTEN_REGISTERS)
    client.write_registers(slave.unit, 100, values)
    same(client.read_holding_registers(slave.unit, 100, model.MOST_WRITTEN_REGISTERS), values)
    expected = [model.input_register(i) for i in range(model.MOST_READ_REGISTERS)]
    same(client.read_input_registers(slave.unit, 0, model.MOST_READ_REGISTERS), expected)


def most_bits(client, slave, random):
    expected = [model.discrete_input(i) for i in range(model.MOST_READ_BITS)]
    same(client.read_discrete_inputs(slave.unit, 0, model.MOST_READ_BITS), expected)
    values = bits(random, model.MOST_WRITTEN_BITS)
    client.write_coils(slave.unit, 0, values)
    same(client.read_coils(slave.unit, 0, model.MOST_WRITTEN_BITS), values)


def mask_write(client, slave, random):
    value, and_mask, or_mask = words(random, 3)
    client.write_register(slave.unit, 5, value)
    client.mask_write(slave.unit, 5, and_mask, or_mask)
    expected = value & and_mask | or_mask & ~and_mask & 0xFFFF
    same(client.read_holding_registers(slave.unit, 5, 1), [expected])


def read_write(client, slave, random):
    values = words(random, 4)
    # Written before it is read: the two ranges overlap.
    client.write_registers(slave.unit, 60, [1, 2, 3, 4, 5, 6])
    same(client.read_write(slave.unit, 60, 6, 61, values), [1, *values, 6])
    values = words(random, model.MOST_READ_WRITE)
    received = client.read_write(slave.unit, 100, model.MOST_READ_REGISTERS, 100, values)
    same(received[: model.MOST_READ_WRITE], values)


def illegal_address(client, slave, _random):
    unit, nowhere = slave.unit, model.NOWHERE
    refused(2, lambda: client.read_coils(unit, nowhere, 1))
    refused(2, lambda: client.read_discrete_inputs(unit, nowhere, 1))
    refused(2, lambda: client.read_holding_registers(unit, nowhere, 1))
    refused(2, lambda: client.read_input_registers(unit, nowhere, 1))
    refused(2, lambda: client.write_register(unit, nowhere, 1))
    refused(2, lambda: client.write_registers(unit, nowhere, [1, 2]))
    refused(2, lambda: client.write_coil(unit, nowhere, True))
    refused(2, lambda: client.write_coils(unit, nowhere, [True, False]))


def server_id(client, slave, _random):
    same(client.server_id(slave.unit), slave.server_id[:-1])


def diagnostics(client, slave, random):
    data = random.randbytes(2)
    same(client.diagnostics(slave.unit, data), data)


def identification(client, slave, _random):
    same(client.identification(slave.unit), model.IDENTITY)


def exception_status(client, slave, _random):
    same(client.exception_status(slave.unit), 0)


def event_counter(client, slave, _random):
    same(client.event_counter(slave.unit), 0)


# For every slave. Functions 07 and 0B have no types in the gateway: they pass through it unseen.
CASES = [
    Case("02 read discrete inputs", read_inputs),
    Case("04 read input registers", read_input_registers),
    Case("05 write coil, 01 read coils", write_coil),
    Case("0F write coils, 01 read coils", write_coils),
    Case("06 write register, 03 read holding registers", write_register),
    Case("10 write registers, 03 read holding registers", write_registers),
    Case("123 registers written, 125 read", most_registers),
    Case("1968 coils written, 2000 inputs read", most_bits, client_needs="most_bits"),
    Case("16 mask write register", mask_write, client_needs="mask_write"),
    Case("17 read/write registers, 125 and 121", read_write, client_needs="read_write"),
    Case("exception 02 from the slave", illegal_address),
    Case("11 report server id", server_id, needs="server_id"),
    Case("08 diagnostics, return query data", diagnostics, needs="diagnostics"),
    Case("2B/0E read device identification", identification, needs="identification"),
    Case("07 read exception status", exception_status, needs="exception_status"),
    Case("0B get comm event counter", event_counter, needs="event_counter"),
]


def unmapped_unit(client, _slave, _random):
    refused(0x0A, lambda: client.read_holding_registers(model.UNMAPPED_UNIT, 0, 1))


def silent_unit(client, slave, _random):
    refused(0x0B, lambda: client.read_holding_registers(model.SILENT_UNIT, 0, 1))
    # Its neighbour on the line does not suffer.
    same(client.read_input_registers(slave.unit, 0, 1), [model.input_register(0)])


def broadcast(client, _slave, random):
    value = random.randrange(0x10000)
    client.broadcast_register(29, value)
    for slave in model.SLAVES:
        same(client.read_holding_registers(slave.unit, 29, 1), [value])


# Once a client and port.
GATEWAY_CASES = [
    Case("exception 0A, unit on no bus", unmapped_unit),
    Case("exception 0B, unit that is silent", silent_unit),
    Case("broadcast to every bus", broadcast, client_needs="broadcast"),
]
