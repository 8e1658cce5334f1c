#include "host_rig.h"

#include <stdlib.h>
#include <string.h>

#include "frame.h"
#include "report.h"
#include "rig.h"

enum { QUEUE = 64 };

struct message {
    uint8_t length;
    uint8_t bytes[RIG_MESSAGE_MAX];
};

struct host_rig {
    struct rig rig;
    struct rig_description description;
    struct frame_receiver receiver;

    uint32_t now_us;
    int32_t position[RIG_AXES];
    int32_t force_un[RIG_AXES];
    uint16_t buttons;
    bool home_switch;
    uint32_t syncs;
    struct rig_problem problem; /* what is present */
    struct rig_problem slip;    /* what was seen of the sensor */
    bool slips_when_driven;

    struct message sent[QUEUE];
    size_t first, count;
    uint8_t frame[FRAME_MAX]; /* the one that is being read */
    size_t frame_length, frame_read;
};

static const struct rig_description DESCRIPTION = {
    .axes = 1,
    .capabilities = RIG_HAS_HOME_SWITCH,
    .buttons = 1,
    .host_silence_ms = 20,
    .nominal_rate_hz = 1000,
    .firmware = {1, 0, 0},
    .model = "host-rig",
    .serial = "0001",
};

static const struct rig_axis AXIS = {
    .count_pm = 7669904, .max_force_un = 5000000, .lowest = -6500, .highest = 6500};

static uint32_t micros(void *board)
{
    return ((struct host_rig *)board)->now_us;
}

static int32_t position(void *board, uint8_t axis)
{
    return ((struct host_rig *)board)->position[axis];
}

static uint16_t buttons(void *board)
{
    return ((struct host_rig *)board)->buttons;
}

static bool home_switch(void *board)
{
    return ((struct host_rig *)board)->home_switch;
}

static void turn_sync(void *board)
{
    ((struct host_rig *)board)->syncs++;
}

static void drive(void *board, uint8_t axis, int32_t force_un)
{
    struct host_rig *host = board;
    host->force_un[axis] = force_un;
    if (host->slips_when_driven) {
        host->slips_when_driven = false;
        host->slip = (struct rig_problem){RIG_SENSOR_FAULT, axis, host->position[axis]};
    }
}

static bool problem(void *board, struct rig_problem *problem)
{
    const struct host_rig *host = board;
    *problem = host->slip.fault != RIG_NO_FAULT ? host->slip : host->problem;
    return problem->fault != RIG_NO_FAULT;
}

static void forget_problem(void *board, uint8_t fault)
{
    if (fault == RIG_SENSOR_FAULT) {
        ((struct host_rig *)board)->slip.fault = RIG_NO_FAULT;
    }
}

static void send(void *board, const uint8_t *bytes, uint8_t length)
{
    struct host_rig *host = board;
    if (host->count == QUEUE) {
        return;
    }
    struct message *slot = &host->sent[(host->first + host->count++) % QUEUE];
    slot->length = length;
    memcpy(slot->bytes, bytes, length);
}

static const struct rig_hal HAL = {micros, position, buttons, home_switch, turn_sync, drive, problem, forget_problem, send};

struct host_rig *host_rig_new(uint8_t axes)
{
    if (axes < 1 || axes > RIG_AXES) {
        return NULL;
    }
    struct host_rig *host = calloc(1, sizeof *host);
    if (host != NULL) {
        host->description = DESCRIPTION;
        host->description.axes = axes;
        for (uint8_t axis = 0; axis < axes; axis++) {
            host->description.axis[axis] = AXIS;
        }
        host_rig_restart(host);
    }
    return host;
}

void host_rig_free(struct host_rig *host)
{
    free(host);
}

void host_rig_restart(struct host_rig *host)
{
    memset(&host->receiver, 0, sizeof host->receiver);
    host->count = host->frame_length = host->frame_read = 0;
    host->now_us = 0;
    host->slip.fault = RIG_NO_FAULT;
    rig_start(&host->rig, &host->description, &HAL, host);
}

struct rig_description *host_rig_description(struct host_rig *host)
{
    return &host->description;
}

void host_rig_clock(struct host_rig *host, uint32_t now_us)
{
    host->now_us = now_us;
    rig_work(&host->rig);
}

void host_rig_stall(struct host_rig *host, uint32_t now_us)
{
    host->now_us = now_us;
}

void host_rig_set_position(struct host_rig *host, uint8_t axis, int32_t counts)
{
    host->position[axis] = counts;
}

void host_rig_set_buttons(struct host_rig *host, uint16_t bits)
{
    host->buttons = bits;
}

void host_rig_set_home_switch(struct host_rig *host, bool closed)
{
    host->home_switch = closed;
}

void host_rig_break(struct host_rig *host, uint8_t fault, uint8_t axis, int32_t detail)
{
    host->problem = (struct rig_problem){fault, axis, detail};
    if (fault == RIG_SENSOR_FAULT) {
        host->slip = host->problem;
    }
}

void host_rig_slip_when_driven(struct host_rig *host)
{
    host->slips_when_driven = true;
}

void host_rig_mend(struct host_rig *host)
{
    host->problem.fault = RIG_NO_FAULT;
}

int32_t host_rig_force(const struct host_rig *host, uint8_t axis)
{
    return host->force_un[axis];
}

uint32_t host_rig_syncs(const struct host_rig *host)
{
    return host->syncs;
}

void host_rig_write(struct host_rig *host, const uint8_t *bytes, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        switch (frame_receive(&host->receiver, bytes[i])) {
        case FRAME_NOTHING:
            break;
        case FRAME_MESSAGE:
            rig_receive(&host->rig, host->receiver.bytes, host->receiver.length);
            break;
        case FRAME_DAMAGED:
            rig_receive_damaged(&host->rig);
            break;
        }
    }
}

size_t host_rig_read(struct host_rig *host, uint8_t *bytes, size_t size)
{
    size_t read = 0;
    while (read < size) {
        if (host->frame_read == host->frame_length) {
            uint8_t message[RIG_MESSAGE_MAX];
            uint8_t length = host_rig_read_message(host, message);
            if (length == 0) {
                break;
            }
            host->frame_length = frame_make(message, length, host->frame);
            host->frame_read = 0;
        }
        bytes[read++] = host->frame[host->frame_read++];
    }
    return read;
}

void host_rig_write_report(struct host_rig *host, const uint8_t *report, size_t length)
{
    uint8_t message = length == REPORT_SIZE ? report_message(report) : 0;
    if (message == 0) {
        rig_receive_damaged(&host->rig);
    } else {
        rig_receive(&host->rig, report + 1, message);
    }
}

bool host_rig_read_report(struct host_rig *host, uint8_t *report)
{
    uint8_t message[RIG_MESSAGE_MAX];
    uint8_t length = host_rig_read_message(host, message);
    if (length == 0) {
        return false;
    }
    report_make(message, length, report);
    return true;
}

uint8_t host_rig_read_message(struct host_rig *host, uint8_t *message)
{
    if (host->count == 0) {
        return 0;
    }
    const struct message *slot = &host->sent[host->first];
    memcpy(message, slot->bytes, slot->length);
    host->first = (host->first + 1) % QUEUE;
    host->count--;
    return slot->length;
}
