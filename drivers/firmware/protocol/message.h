/* The numbers of docs/rig-protocol.md, and how they lie in bytes. */
#ifndef RIG_MESSAGE_H
#define RIG_MESSAGE_H

#include <stdint.h>

enum {
    RIG_VERSION = 1,
    RIG_AXES = 3,          /* most axes of a rig */
    RIG_MESSAGE_MIN = 6,   /* version, type, sequence, CRC */
    RIG_MESSAGE_MAX = 63,  /* so that a message and its length fit a report */
};

enum rig_type {
    RIG_HELLO = 0x01,
    RIG_DESCRIBE = 0x02,
    RIG_SET_HOME = 0x03,
    RIG_ENABLE = 0x04,
    RIG_DISABLE = 0x05,
    RIG_POLL = 0x06,
    RIG_FORCE = 0x07,
    RIG_PING = 0x08,

    RIG_IDENTITY = 0x81,
    RIG_AXIS = 0x82,
    RIG_STATE = 0x84,
    RIG_PONG = 0x88,
    RIG_FAULT = 0x90,
    RIG_REFUSED = 0x91,
};

enum rig_flag {
    RIG_ENABLED = 1 << 0,
    RIG_HOMED = 1 << 1,
    RIG_WATCHDOG = 1 << 2,
    RIG_LIMITED = 1 << 3,
    RIG_HOME_SWITCH = 1 << 4,
};

enum rig_capability {
    RIG_HAS_HOME_SWITCH = 1 << 0,
    RIG_KNOWS_HOME = 1 << 1,
};

enum rig_fault {
    RIG_NO_FAULT = 0,
    RIG_SENSOR_FAULT = 1,
    RIG_MOTOR_FAULT = 2,
    RIG_RESTART_FAULT = 3,
};

enum { RIG_NO_AXIS = 255 };

enum rig_refusal {
    RIG_WRONG_VERSION = 1,
    RIG_UNKNOWN_TYPE = 2,
    RIG_WRONG_LENGTH = 3,
    RIG_NO_HELLO = 4,
    RIG_WRONG_AXIS = 5,
};

static inline uint16_t get_u16(const uint8_t *at)
{
    return (uint16_t)(at[0] | (uint16_t)at[1] << 8);
}

static inline uint32_t get_u32(const uint8_t *at)
{
    return get_u16(at) | (uint32_t)get_u16(at + 2) << 16;
}

static inline int32_t get_i32(const uint8_t *at)
{
    return (int32_t)get_u32(at); /* every compiler that this is for wraps here */
}

static inline uint8_t *put_u8(uint8_t *at, uint8_t value)
{
    *at = value;
    return at + 1;
}

static inline uint8_t *put_u16(uint8_t *at, uint16_t value)
{
    return put_u8(put_u8(at, (uint8_t)value), (uint8_t)(value >> 8));
}

static inline uint8_t *put_u32(uint8_t *at, uint32_t value)
{
    return put_u16(put_u16(at, (uint16_t)value), (uint16_t)(value >> 16));
}

static inline uint8_t *put_i32(uint8_t *at, int32_t value)
{
    return put_u32(at, (uint32_t)value);
}

#endif
