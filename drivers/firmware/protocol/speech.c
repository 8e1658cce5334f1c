#include "speech.h"

#include <string.h>

#include "crc16.h"

struct outgoing {
    uint8_t bytes[RIG_MESSAGE_MAX];
    uint8_t *end;
};

static void begin(struct rig *rig, struct outgoing *out, uint8_t type, uint32_t time_us)
{
    out->end = put_u8(out->bytes, RIG_VERSION);
    out->end = put_u8(out->end, type);
    out->end = put_u16(out->end, rig->sequence++);
    out->end = put_u16(out->end, rig->echo);
    out->end = put_u32(out->end, time_us);
}

static void finish(struct rig *rig, struct outgoing *out)
{
    out->end = put_u16(out->end, crc16(out->bytes, (size_t)(out->end - out->bytes)));
    rig->hal->send(rig->board, out->bytes, (uint8_t)(out->end - out->bytes));
}

static uint8_t *put_text(uint8_t *at, const char *text, size_t size)
{
    memcpy(at, text, size);
    return at + size;
}

static uint8_t flags(const struct rig *rig)
{
    uint8_t all_axes = (uint8_t)((1 << rig->description->axes) - 1);
    return (uint8_t)((rig->enabled ? RIG_ENABLED : 0) | (rig->homed == all_axes ? RIG_HOMED : 0) |
                     (rig->tripped ? RIG_WATCHDOG : 0) | (rig->limited ? RIG_LIMITED : 0) |
                     (rig->hal->home_switch(rig->board) ? RIG_HOME_SWITCH : 0));
}

void say_identity(struct rig *rig)
{
    const struct rig_description *about = rig->description;
    struct outgoing out;
    begin(rig, &out, RIG_IDENTITY, rig->hal->micros(rig->board));
    out.end = put_u8(out.end, about->axes);
    out.end = put_u8(out.end, about->capabilities);
    out.end = put_u8(out.end, about->buttons);
    out.end = put_u8(out.end, flags(rig));
    out.end = put_u16(out.end, about->host_silence_ms);
    out.end = put_u16(out.end, about->nominal_rate_hz);
    for (uint8_t i = 0; i < sizeof about->firmware; i++) {
        out.end = put_u8(out.end, about->firmware[i]);
    }
    out.end = put_text(out.end, about->model, sizeof about->model);
    out.end = put_text(out.end, about->serial, sizeof about->serial);
    finish(rig, &out);
}

void say_axis(struct rig *rig, uint8_t axis)
{
    const struct rig_axis *about = &rig->description->axis[axis];
    struct outgoing out;
    begin(rig, &out, RIG_AXIS, rig->hal->micros(rig->board));
    out.end = put_u8(out.end, axis);
    out.end = put_u32(out.end, about->count_pm);
    out.end = put_u32(out.end, about->max_force_un);
    out.end = put_i32(out.end, about->lowest);
    out.end = put_i32(out.end, about->highest);
    out.end = put_i32(out.end, rig->home[axis]);
    finish(rig, &out);
}

void say_state(struct rig *rig)
{
    struct outgoing out;
    begin(rig, &out, RIG_STATE, rig->hal->micros(rig->board));
    out.end = put_u8(out.end, flags(rig));
    out.end = put_u8(out.end, rig->fault);
    out.end = put_u16(out.end, rig->hal->buttons(rig->board));
    for (uint8_t axis = 0; axis < rig->description->axes; axis++) {
        out.end = put_i32(out.end, rig->hal->position(rig->board, axis));
    }
    for (uint8_t axis = 0; axis < rig->description->axes; axis++) {
        out.end = put_i32(out.end, rig->force_un[axis]);
    }
    finish(rig, &out);
}

void say_pong(struct rig *rig, uint32_t token, uint32_t received_us)
{
    struct outgoing out;
    begin(rig, &out, RIG_PONG, rig->hal->micros(rig->board));
    out.end = put_u32(out.end, token);
    out.end = put_u32(out.end, received_us);
    out.end = put_u16(out.end, rig->lost);
    out.end = put_u16(out.end, rig->damaged);
    out.end = put_u16(out.end, rig->stale);
    finish(rig, &out);
}

void say_fault(struct rig *rig, const struct rig_problem *problem)
{
    struct outgoing out;
    begin(rig, &out, RIG_FAULT, rig->hal->micros(rig->board));
    out.end = put_u8(out.end, problem->fault);
    out.end = put_u8(out.end, problem->axis);
    out.end = put_i32(out.end, problem->detail);
    finish(rig, &out);
}

void say_refused(struct rig *rig, enum rig_refusal reason, uint8_t type)
{
    struct outgoing out;
    begin(rig, &out, RIG_REFUSED, rig->hal->micros(rig->board));
    out.end = put_u8(out.end, (uint8_t)reason);
    out.end = put_u8(out.end, type);
    finish(rig, &out);
}
