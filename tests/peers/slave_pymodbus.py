"""A pymodbus slave: slave_pymodbus.py DEVICE rtu|ascii UNIT."""

import asyncio
import sys

from pymodbus import FramerType
from pymodbus.pdu.device import ModbusDeviceIdentification
from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice

import model


def device(unit):
    def bits(value, count):
        return [SimData(0, values=[value(i) for i in range(count)], datatype=DataType.BITS)]

    def registers(value, count):
        return [SimData(0, values=[value(i) for i in range(count)], datatype=DataType.REGISTERS)]

    blocks = (
        bits(model.coil, model.COILS),
        bits(model.discrete_input, model.DISCRETE_INPUTS),
        registers(lambda _: 0, model.HOLDING_REGISTERS),
        registers(model.input_register, model.INPUT_REGISTERS),
    )
    return SimDevice(unit, simdata=blocks)


async def main(path, framing, unit):
    server = ModbusSerialServer(
        device(int(unit)),
        framer={"rtu": FramerType.RTU, "ascii": FramerType.ASCII}[framing],
        identity=ModbusDeviceIdentification({number: text.decode() for number, text in model.IDENTITY.items()}),
        port=path,
        baudrate=115200,
        broadcast_enable=True,
    )
    await server.serve_forever(background=True)
    print("ready", flush=True)
    await asyncio.Event().wait()


asyncio.run(main(*sys.argv[1:]))
