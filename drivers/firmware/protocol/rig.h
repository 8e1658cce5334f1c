/* The device's side of docs/rig-protocol.md: one state machine for every board and every transport. */
#ifndef RIG_RIG_H
#define RIG_RIG_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"
#include "message.h"

struct rig {
    const struct rig_description *description;
    const struct rig_hal *hal;
    void *board;

    bool greeted;
    bool enabled;
    bool tripped; /* the watchdog */
    bool limited;
    uint8_t fault;
    uint8_t homed; /* bit i: axis i */
    int32_t force_un[RIG_AXES];
    int32_t home[RIG_AXES];
    uint32_t fed_us; /* when the watchdog was fed */

    bool answer_due; /* a STATE is to be sent at answer_us */
    uint32_t answer_us;

    uint16_t sequence; /* of the next message to send */
    uint16_t echo;     /* of the last one accepted */
    uint16_t lost;
    uint16_t damaged;
    uint16_t stale;
};

/* Begin without force and without a host. What is pointed to stays the caller's and must stay. */
void rig_start(struct rig *rig, const struct rig_description *description, const struct rig_hal *hal, void *board);

/* Take a message as it came, CRC included and not yet checked. */
void rig_receive(struct rig *rig, const uint8_t *message, uint8_t length);

/* Count a frame or report that held no message. */
void rig_receive_damaged(struct rig *rig);

/* Watchdog, faults and answers that are due: to be called all the time. */
void rig_work(struct rig *rig);

#endif
