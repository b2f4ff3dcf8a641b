/* A libmodbus slave: slave_libmodbus DEVICE UNIT. It holds what model.py says. */

#include <errno.h>
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>

enum { COILS = 2000, DISCRETE_INPUTS = 2000, HOLDING_REGISTERS = 300, INPUT_REGISTERS = 300 };

static int fail(const char *what)
{
    fprintf(stderr, "slave_libmodbus: %s: %s\n", what, modbus_strerror(errno));
    return EXIT_FAILURE;
}

int main(int argc, char **argv)
{
    uint8_t request[MODBUS_RTU_MAX_ADU_LENGTH];
    modbus_mapping_t *map;
    modbus_t *line;
    int i, length;

    if (argc != 3)
        return EXIT_FAILURE;
    /* A pseudo terminal has no parity, and says so when asked for some. */
    line = modbus_new_rtu(argv[1], 115200, 'N', 8, 1);
    if (line == NULL || modbus_set_slave(line, atoi(argv[2])) == -1)
        return fail("line");
    map = modbus_mapping_new(COILS, DISCRETE_INPUTS, HOLDING_REGISTERS, INPUT_REGISTERS);
    if (map == NULL)
        return fail("memory");
    for (i = 0; i < COILS; i++)
        map->tab_bits[i] = i % 3 == 0;
    for (i = 0; i < DISCRETE_INPUTS; i++)
        map->tab_input_bits[i] = i * i % 7 < 3;
    for (i = 0; i < INPUT_REGISTERS; i++)
        map->tab_input_registers[i] = (uint16_t) (i * 1021 + 7);
    if (modbus_connect(line) == -1)
        return fail(argv[1]);
    puts("ready");
    fflush(stdout);
    for (;;) {
        length = modbus_receive(line, request);
        /* 0: for another unit. -1: no frame; what came of it is dropped. */
        if (length > 0)
            modbus_reply(line, request, length, map);
        else if (length == -1)
            modbus_flush(line);
    }
}
