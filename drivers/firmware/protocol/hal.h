/* What the protocol core needs of a board: a clock, sensors, a motor, a way to send. */
#ifndef RIG_HAL_H
#define RIG_HAL_H

#include <stdbool.h>
#include <stdint.h>

#include "message.h"

struct rig_axis {
    uint32_t count_pm;     /* travel of the handle a count [pm]; 0: unknown */
    uint32_t max_force_un; /* [uN] */
    int32_t lowest;        /* end stops [counts from home]; both 0: unknown */
    int32_t highest;
};

struct rig_description {
    uint8_t axes;
    uint8_t capabilities;
    uint8_t buttons;
    uint16_t host_silence_ms;
    uint16_t nominal_rate_hz;
    uint8_t firmware[3];
    char model[16];  /* filled up with zeros, not necessarily ended by one */
    char serial[12];
    struct rig_axis axis[RIG_AXES];
};

struct rig_problem {
    uint8_t fault;
    uint8_t axis;
    int32_t detail;
};

/* All are called from the main loop, with `board` as the first argument. */
struct rig_hal {
    uint32_t (*micros)(void *board);
    int32_t (*position)(void *board, uint8_t axis);                   /* [counts] */
    uint16_t (*buttons)(void *board);
    bool (*home_switch)(void *board);
    void (*sync)(void *board); /* a position is taken for a tick: turn the sync output, where there is one */
    void (*drive)(void *board, uint8_t axis, int32_t force_un);       /* 0: the motor is without current */
    /* Is there one, seen or still present? The sensor's before any other. */
    bool (*problem)(void *board, struct rig_problem *problem);
    /* What was seen of this fault: not of others, which the core may not know of yet, nor what is still present. */
    void (*forget_problem)(void *board, uint8_t fault);
    void (*send)(void *board, const uint8_t *message, uint8_t length); /* whole or not at all, without waiting */
};

#endif
