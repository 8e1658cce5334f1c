#include "rig.h"

#include <string.h>

#include "crc16.h"
#include "speech.h"

enum { HOST_HEADER = 4, CRC_SIZE = 2 };

static uint32_t now_us(const struct rig *rig)
{
    return rig->hal->micros(rig->board);
}

static void switch_off(struct rig *rig)
{
    rig->enabled = false;
    rig->limited = false;
    for (uint8_t axis = 0; axis < rig->description->axes; axis++) {
        rig->force_un[axis] = 0;
        rig->hal->drive(rig->board, axis, 0);
    }
}

static void look_for_problems(struct rig *rig)
{
    struct rig_problem problem;
    if (!rig->hal->problem(rig->board, &problem) || problem.fault == rig->fault) {
        return;
    }
    bool slipped = problem.fault == RIG_SENSOR_FAULT;
    if (rig->fault != RIG_NO_FAULT && !slipped) {
        return;
    }
    switch_off(rig);
    rig->fault = problem.fault; /* a slip in the place of any other, behind which it would be forgotten */
    bool knows_home = rig->description->capabilities & RIG_KNOWS_HOME;
    if (slipped && !knows_home) {
        rig->homed = 0; /* counts were lost: the origin has moved; all, since another axis may hide behind this one */
    }
    say_fault(rig, &problem);
}

static void look_at_watchdog(struct rig *rig)
{
    uint32_t silence_us = (uint32_t)rig->description->host_silence_ms * 1000;
    if (rig->enabled && now_us(rig) - rig->fed_us > silence_us) {
        switch_off(rig);
        rig->tripped = true;
    }
}

static void answer_at_once(struct rig *rig)
{
    rig->answer_due = false; /* the one that waited is replaced */
    say_state(rig);
}

/* The answer to a POLL or a FORCE, of which a host sends one a tick. */
static void answer_tick(struct rig *rig)
{
    rig->hal->sync(rig->board);
    answer_at_once(rig);
}

static void answer_after(struct rig *rig, uint16_t wait_us)
{
    if (wait_us == 0) {
        answer_tick(rig);
        return;
    }
    rig->answer_due = true;
    rig->answer_us = now_us(rig) + wait_us;
}

static void enable(struct rig *rig)
{
    if (rig->enabled || rig->fault != RIG_NO_FAULT) {
        return;
    }
    rig->enabled = true;
    rig->tripped = false;
    rig->fed_us = now_us(rig);
}

static void disable(struct rig *rig)
{
    struct rig_problem problem;
    switch_off(rig);
    rig->hal->forget_problem(rig->board, rig->fault);
    if (!rig->hal->problem(rig->board, &problem) || problem.fault != rig->fault) {
        rig->fault = RIG_NO_FAULT;
    }
    look_for_problems(rig); /* one that was hidden behind it, or is new */
}

static int32_t limited_to(int32_t force_un, uint32_t limit_un)
{
    uint32_t magnitude = force_un < 0 ? 0u - (uint32_t)force_un : (uint32_t)force_un;
    if (magnitude <= limit_un) {
        return force_un;
    }
    return force_un < 0 ? -(int32_t)limit_un : (int32_t)limit_un;
}

static void apply(struct rig *rig, const uint8_t *forces)
{
    if (!rig->enabled) {
        return;
    }
    rig->fed_us = now_us(rig);
    rig->limited = false;
    for (uint8_t axis = 0; axis < rig->description->axes; axis++) {
        int32_t wanted_un = get_i32(forces + 4 * axis);
        rig->force_un[axis] = limited_to(wanted_un, rig->description->axis[axis].max_force_un);
        rig->limited = rig->limited || rig->force_un[axis] != wanted_un;
        rig->hal->drive(rig->board, axis, rig->force_un[axis]);
    }
}

static bool crc_fits(const uint8_t *message, uint8_t length)
{
    uint8_t covered = (uint8_t)(length - CRC_SIZE);
    return get_u16(message + covered) == crc16(message, covered);
}

/* Length of the payload of a host message; -1: no such type. */
static int8_t payload_size(uint8_t type, uint8_t axes)
{
    switch (type) {
    case RIG_HELLO:
    case RIG_ENABLE:
    case RIG_DISABLE:
        return 0;
    case RIG_DESCRIBE:
        return 1;
    case RIG_SET_HOME:
        return 5;
    case RIG_POLL:
        return 2;
    case RIG_FORCE:
        return (int8_t)(2 + 4 * axes);
    case RIG_PING:
        return 4;
    default:
        return -1;
    }
}

static void carry_out(struct rig *rig, uint8_t type, const uint8_t *payload)
{
    bool about_an_axis = type == RIG_DESCRIBE || type == RIG_SET_HOME;
    if (about_an_axis && payload[0] >= rig->description->axes) {
        say_refused(rig, RIG_WRONG_AXIS, type);
        return;
    }
    switch (type) {
    case RIG_HELLO:
        switch_off(rig);
        rig->greeted = true;
        rig->answer_due = false;
        say_identity(rig);
        break;
    case RIG_SET_HOME:
        rig->home[payload[0]] = get_i32(payload + 1);
        if (rig->fault != RIG_SENSOR_FAULT) { /* then it may have been found before counts were lost */
            rig->homed = (uint8_t)(rig->homed | 1 << payload[0]);
        }
        say_axis(rig, payload[0]);
        break;
    case RIG_DESCRIBE:
        say_axis(rig, payload[0]);
        break;
    case RIG_ENABLE:
        enable(rig);
        answer_at_once(rig);
        break;
    case RIG_DISABLE:
        disable(rig);
        answer_at_once(rig);
        break;
    case RIG_POLL:
        answer_after(rig, get_u16(payload));
        break;
    case RIG_FORCE:
        apply(rig, payload + 2);
        answer_after(rig, get_u16(payload));
        break;
    case RIG_PING:
        say_pong(rig, get_u32(payload), now_us(rig));
        break;
    }
}

void rig_start(struct rig *rig, const struct rig_description *description, const struct rig_hal *hal, void *board)
{
    memset(rig, 0, sizeof *rig);
    rig->description = description;
    rig->hal = hal;
    rig->board = board;
    if (description->capabilities & RIG_KNOWS_HOME) {
        rig->homed = (uint8_t)((1 << description->axes) - 1);
    }
    switch_off(rig);
}

void rig_receive_damaged(struct rig *rig)
{
    rig->damaged++;
}

void rig_receive(struct rig *rig, const uint8_t *message, uint8_t length)
{
    rig_work(rig); /* first: a force that comes too late must find the motor off */
    if (length < RIG_MESSAGE_MIN || length > RIG_MESSAGE_MAX || !crc_fits(message, length)) {
        rig->damaged++;
        return;
    }
    uint8_t type = message[1];
    int8_t payload = payload_size(type, rig->description->axes);
    if (message[0] != RIG_VERSION) {
        say_refused(rig, RIG_WRONG_VERSION, type);
    } else if (payload < 0) {
        say_refused(rig, RIG_UNKNOWN_TYPE, type);
    } else if (length != HOST_HEADER + payload + CRC_SIZE) {
        say_refused(rig, RIG_WRONG_LENGTH, type);
    } else if (!rig->greeted && type != RIG_HELLO) {
        say_refused(rig, RIG_NO_HELLO, type);
    } else {
        uint16_t sequence = get_u16(message + 2);
        uint16_t ahead = (uint16_t)(sequence - rig->echo);
        if (type != RIG_HELLO) {
            if (ahead == 0 || ahead > 0x7fff) {
                rig->stale++;
                return;
            }
            rig->lost = (uint16_t)(rig->lost + ahead - 1);
        }
        rig->echo = sequence;
        carry_out(rig, type, message + HOST_HEADER);
    }
}

void rig_work(struct rig *rig)
{
    look_for_problems(rig);
    look_at_watchdog(rig);
    if (rig->answer_due && now_us(rig) - rig->answer_us < 0x80000000u) {
        answer_tick(rig);
    }
}
