/* Messages on a byte stream: COBS, each ended by a zero. */
#ifndef RIG_FRAME_H
#define RIG_FRAME_H

#include <stdbool.h>
#include <stdint.h>

#include "message.h"

enum {
    FRAME_ENCODED_MAX = RIG_MESSAGE_MAX + 1,
    FRAME_MAX = FRAME_ENCODED_MAX + 1, /* with the zero */
};

enum frame_event { FRAME_NOTHING, FRAME_MESSAGE, FRAME_DAMAGED };

struct frame_receiver {
    uint8_t bytes[FRAME_ENCODED_MAX];
    uint8_t collected;
    uint8_t length; /* of the message */
    bool skipping;  /* overlong: nothing counts until the next zero */
};

/* Take one byte. After FRAME_MESSAGE, `length` of `bytes` are the message until the next call. */
enum frame_event frame_receive(struct frame_receiver *receiver, uint8_t byte);

/* Make the frame of a message, at most FRAME_MAX bytes. Returns its length. */
uint8_t frame_make(const uint8_t *message, uint8_t length, uint8_t *frame);

#endif
