/* Consistent Overhead Byte Stuffing for blocks of fewer than 254 bytes, where it adds exactly one byte.
 * Cheshire & Baker, "Consistent overhead byte stuffing", IEEE/ACM Transactions on Networking 7(2), 1999. */
#ifndef RIG_COBS_H
#define RIG_COBS_H

#include <stdint.h>

/* Encode `length` (at most 253) bytes into `encoded`, which holds one more. Returns how many were written. */
uint8_t cobs_encode(const uint8_t *plain, uint8_t length, uint8_t *encoded);

/* Decode in place. Returns the length of what is left, or -1 when `bytes` is no encoding. */
int16_t cobs_decode(uint8_t *bytes, uint8_t length);

#endif
