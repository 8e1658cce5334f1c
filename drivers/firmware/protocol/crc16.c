#include "crc16.h"

/* A byte at a time without a table, and in bytes, which is what an 8-bit processor is quick at. With
 * x = high ^ byte and y = x ^ x >> 4, eight shifts of the register come to low : 0 ^ y << 12 ^ y << 5 ^ y. */
uint16_t crc16(const uint8_t *bytes, size_t length)
{
    uint8_t high = 0xff;
    uint8_t low = 0xff;
    for (size_t i = 0; i < length; i++) {
        uint8_t x = high ^ bytes[i];
        x ^= (uint8_t)(x >> 4);
        high = (uint8_t)(low ^ x << 4 ^ x >> 3);
        low = (uint8_t)(x ^ x << 5);
    }
    return (uint16_t)(high << 8 | low);
}
