#include "frame.h"

#include "cobs.h"

static enum frame_event finish(struct frame_receiver *receiver)
{
    uint8_t collected = receiver->collected;
    bool skipped = receiver->skipping;
    receiver->collected = 0;
    receiver->skipping = false;
    if (skipped || collected == 0) {
        return FRAME_NOTHING;
    }
    int16_t length = cobs_decode(receiver->bytes, collected);
    if (length < 0) {
        return FRAME_DAMAGED;
    }
    receiver->length = (uint8_t)length;
    return FRAME_MESSAGE;
}

enum frame_event frame_receive(struct frame_receiver *receiver, uint8_t byte)
{
    if (byte == 0) {
        return finish(receiver);
    }
    if (receiver->skipping) {
        return FRAME_NOTHING;
    }
    if (receiver->collected == FRAME_ENCODED_MAX) {
        receiver->skipping = true;
        return FRAME_DAMAGED;
    }
    receiver->bytes[receiver->collected++] = byte;
    return FRAME_NOTHING;
}

uint8_t frame_make(const uint8_t *message, uint8_t length, uint8_t *frame)
{
    uint8_t encoded = cobs_encode(message, length, frame);
    frame[encoded] = 0;
    return (uint8_t)(encoded + 1);
}
