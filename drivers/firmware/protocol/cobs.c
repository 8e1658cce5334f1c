#include "cobs.h"

uint8_t cobs_encode(const uint8_t *plain, uint8_t length, uint8_t *encoded)
{
    uint8_t code_at = 0;
    uint8_t written = 1;
    for (uint8_t i = 0; i < length; i++) {
        if (plain[i] == 0) {
            encoded[code_at] = (uint8_t)(written - code_at);
            code_at = written++;
        } else {
            encoded[written++] = plain[i];
        }
    }
    encoded[code_at] = (uint8_t)(written - code_at);
    return written;
}

int16_t cobs_decode(uint8_t *bytes, uint8_t length)
{
    uint8_t written = 0;
    uint8_t read = 0;
    while (read < length) {
        uint8_t code = bytes[read++];
        if (code == 0 || code - 1 > length - read) {
            return -1;
        }
        for (uint8_t left = (uint8_t)(code - 1); left > 0; left--) {
            if (bytes[read] == 0) {
                return -1;
            }
            bytes[written++] = bytes[read++];
        }
        if (read < length) {
            bytes[written++] = 0;
        }
    }
    return length == 0 ? -1 : written;
}
