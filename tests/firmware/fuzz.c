/* The core under libFuzzer. An input is a script of what a host, a line, a clock and a breaking device may do. A second,
 * plain model of docs/rig-protocol.md lives through the same; after every step the motor must be told what the model
 * says, everything that the device sends must be well formed, and it must tell each fault and every lost home. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fields.h"
#include "host_rig.h"

enum { SILENCE_US = 20000, MAX_FORCE_UN = 5000000, SENSOR = 1, MOST_TOLD = 8 };

static struct host_rig *host;

static struct {
    uint32_t now_us, fed_us;
    bool greeted, enabled, homed;
    uint8_t fault;
    uint8_t present; /* what is broken */
    bool slipped; /* which the board remembers */
    bool slips_when_driven;
    uint8_t to_tell[MOST_TOLD]; /* faults, since the last look */
    unsigned told;
    uint16_t last;
    int32_t force_un;
    uint8_t frame[65];
    unsigned length; /* of what has been collected; 65: overlong */
    uint16_t next_from_device;
} model;

static void require(bool holds, const char *what)
{
    if (!holds) {
        fprintf(stderr, "%s\n", what);
        abort();
    }
}

static bool crc_is_right(const uint8_t *message, unsigned length)
{
    return (message[length - 2] | message[length - 1] << 8) == defined_crc(message, length - 2);
}

static void model_drive(int32_t force_un)
{
    model.force_un = force_un;
    model.slipped = model.slipped || model.slips_when_driven;
    model.slips_when_driven = false;
}

static void model_off(void)
{
    model.enabled = false;
    model_drive(0);
}

static uint8_t model_problem(void)
{
    return model.slipped ? SENSOR : model.present;
}

static void model_look(void)
{
    uint8_t problem = model_problem();
    if (problem != 0 && (model.fault == 0 || (problem == SENSOR && model.fault != SENSOR))) {
        model_off();
        model.fault = problem;
        model.homed = model.homed && problem != SENSOR;
        require(model.told < MOST_TOLD, "more faults at a time than there can be");
        model.to_tell[model.told++] = problem;
    }
}

static void model_work(void)
{
    model_look();
    if (model.enabled && model.now_us - model.fed_us > SILENCE_US) {
        model_off();
    }
}

static void model_receive(const uint8_t *message, unsigned length)
{
    static const unsigned LENGTH[] = {0, 6, 7, 11, 6, 6, 8, 12, 10};
    model_work();
    if (length < 6 || length > 63 || !crc_is_right(message, length) || message[0] != 1 || message[1] < 1 ||
        message[1] > 8 || length != LENGTH[message[1]] || (!model.greeted && message[1] != 1)) {
        return;
    }
    uint16_t sequence = (uint16_t)(message[2] | message[3] << 8);
    if (message[1] != 1 && (int16_t)(uint16_t)(sequence - model.last) <= 0) {
        return;
    }
    model.last = sequence;
    switch (message[1]) {
    case 3:
        model.homed = model.homed || (message[4] == 0 && model.fault != SENSOR);
        break;
    case 1:
        model.greeted = true;
        model_off();
        break;
    case 4:
        if (!model.enabled && model.fault == 0) {
            model.enabled = true;
            model.fed_us = model.now_us;
        }
        break;
    case 5:
        model_off();
        model.slipped = model.slipped && model.fault != SENSOR;
        if (model_problem() != model.fault) {
            model.fault = 0;
        }
        model_look();
        break;
    case 7:
        if (model.enabled) {
            int32_t force_un = (int32_t)(message[6] | message[7] << 8 | message[8] << 16 | (uint32_t)message[9] << 24);
            force_un = force_un > MAX_FORCE_UN ? MAX_FORCE_UN : force_un;
            model.fed_us = model.now_us;
            model_drive(force_un < -MAX_FORCE_UN ? -MAX_FORCE_UN : force_un);
        }
        break;
    }
}

static void model_decode(void)
{
    uint8_t message[65];
    unsigned written = 0;
    for (unsigned read = 0; read < model.length;) {
        unsigned next = read + model.frame[read];
        if (next > model.length) {
            return;
        }
        while (++read < next) {
            message[written++] = model.frame[read];
        }
        if (read < model.length) {
            message[written++] = 0;
        }
    }
    model_receive(message, written);
}

static void model_byte(uint8_t byte)
{
    if (byte != 0) {
        if (model.length < 65) {
            model.frame[model.length++] = byte;
        }
        return;
    }
    if (model.length > 0 && model.length < 65) {
        model_decode();
    }
    model.length = 0;
}

static void write_line(const uint8_t *bytes, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        model_byte(bytes[i]);
    }
    host_rig_write(host, bytes, length);
}

/* A frame by the page and not by the core. */
static void write_frame(const uint8_t *message, unsigned length)
{
    uint8_t frame[66];
    unsigned code = 0, at = 1;
    for (unsigned i = 0; i <= length; i++) {
        if (i == length || message[i] == 0) {
            frame[code] = (uint8_t)(at - code);
            code = at++;
        } else {
            frame[at++] = message[i];
        }
    }
    frame[at - 1] = 0;
    write_line(frame, at);
}

static void look(void)
{
    uint8_t message[64] = {0};
    unsigned told = 0;
    for (uint8_t length; (length = host_rig_read_message(host, message)) != 0;) {
        unsigned expected = 0;
        switch (message[1]) {
        case 0x81: expected = 51; break;
        case 0x82: expected = 33; break;
        case 0x84: expected = 24; break;
        case 0x88: expected = 26; break;
        case 0x90: expected = 18; break;
        case 0x91: expected = 14; break;
        }
        require(message[0] == 1 && length == expected && crc_is_right(message, length), "a malformed message");
        require((message[2] | message[3] << 8) == model.next_from_device++, "a gap in the device's sequence");
        if (message[1] == 0x90) {
            require(told < model.told && message[10] == model.to_tell[told], "a fault is told that the model has not");
            told++;
        }
    }
    require(told == model.told, "a fault is not told");
    model.told = 0;
    if (message[1] == 0x84 || message[1] == 0x81) { /* the last of all: nothing has changed since */
        uint8_t flags = message[message[1] == 0x84 ? 10 : 13];
        require((flags & 1) == model.enabled && (flags >> 1 & 1) == model.homed, "other flags than the model's");
        require(message[1] == 0x81 || message[11] == model.fault, "another fault than the model's");
    }
    require(host_rig_force(host, 0) == model.force_un, "the motor is told something that the model is not");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    memset(&model, 0, sizeof model);
    host = host_rig_new(1);
    while (size >= 3) {
        uint8_t operation = data[0] % 12;
        size_t length = data[1] % 16;
        const uint8_t *rest = data + 2;
        length = length < size - 2 ? length : size - 2;
        data += 2 + length;
        size -= 2 + length;
        switch (operation) {
        case 0: /* bytes as they are */
            write_line(rest, length);
            break;
        case 1:   /* a message of the right length, with the next sequence */
        case 9:   /* the same with one bit turned over */
        case 10:  /* the same, but again or late */
        case 2: { /* a message of any length and sequence */
            static const uint8_t LENGTH[] = {5, 4, 5, 9, 4, 4, 6, 10, 8};
            uint8_t message[20] = {1};
            memcpy(message + 1, rest, length);
            unsigned whole = length + 1 < 4 ? 4 : (unsigned)length + 1;
            if (operation != 2) {
                message[1] %= 9;
                whole = LENGTH[message[1]];
                unsigned late = operation == 10 ? 1 + (length > 0 ? rest[length - 1] % 4u : 0) : 0;
                unsigned sequence = model.last + 1u - late;
                message[2] = (uint8_t)sequence;
                message[3] = (uint8_t)(sequence >> 8);
            }
            uint16_t crc = defined_crc(message, whole);
            message[whole] = (uint8_t)crc;
            message[whole + 1] = (uint8_t)(crc >> 8);
            if (operation == 9) {
                unsigned bit = length > 0 ? rest[length - 1] % (8 * (whole + 2)) : 0;
                message[bit / 8] ^= (uint8_t)(1 << bit % 8);
            }
            write_frame(message, whole + 2);
            break;
        }
        case 3: /* time */
        case 4: { /* time, the device being too busy */
            uint32_t us = 0;
            memcpy(&us, rest, length < 4 ? length : 4);
            us = length < 4 ? us : us % 50000;
            model.now_us += us;
            if (operation == 3) {
                model_work();
                host_rig_clock(host, model.now_us);
            } else {
                host_rig_stall(host, model.now_us);
            }
            break;
        }
        case 5:
            model.present = length > 0 ? rest[0] % 4 : 0;
            model.slipped = model.slipped || model.present == SENSOR;
            host_rig_break(host, model.present, length > 1 ? rest[1] : 0, 0);
            break;
        case 11:
            model.slips_when_driven = true;
            host_rig_slip_when_driven(host);
            break;
        case 6: { /* a report of any length */
            uint8_t report[80] = {0};
            size_t whole = length > 0 && rest[0] > 200 ? rest[0] % 80u : 64;
            memcpy(report, rest, length);
            if (whole == 64 && report[0] >= 6 && report[0] <= 63) {
                model_receive(report + 1, report[0]);
            }
            host_rig_write_report(host, report, whole);
            break;
        }
        case 7:
            host_rig_set_position(host, 0, length > 0 ? rest[0] * 65537 : -1);
            break;
        case 8: {
            uint8_t present = model.present;
            bool slips_when_driven = model.slips_when_driven;
            memset(&model, 0, sizeof model);
            model.present = present;
            model.slips_when_driven = slips_when_driven;
            model_off();
            host_rig_restart(host);
            break;
        }
        }
        look();
    }
    host_rig_free(host);
    return 0;
}
